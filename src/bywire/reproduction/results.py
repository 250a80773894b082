"""A reproduction as a table, as a JSON object, and as a folder of files."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path
from typing import Any

from bywire.core.errors import FileError
from bywire.data.netcdf import write_recording
from bywire.report.files import save_figure, write_bytes
from bywire.report.tables import Table, verdict_table
from bywire.reproduction.in_short import in_short
from bywire.reproduction.report_page import reproduction_row, write_report
from bywire.reproduction.reproduction import Reproduction


def as_json(reproduction: Reproduction) -> dict[str, Any]:
    """Return the object that ``bywire reproduce --json`` prints.

    Returns
    -------
    dict
        ``{"source", "items": [{"id", "unit", "stated", "computed", "tolerance", "agrees",
        "note"}], "in_short"}``. What is not stated, not computed or not defined is None; a
        tolerance is a number in the item's unit, or ``"<="`` or ``">="`` where the statement is a
        bound. The note ends with the kind of statement.
    """
    return {
        "source": reproduction.source,
        "items": [
            {
                "id": item.id,
                "unit": item.unit,
                "stated": _number(item.stated),
                "computed": _number(item.computed),
                "tolerance": item.tolerance
                if isinstance(item.tolerance, str)
                else _number(item.tolerance),
                "agrees": item.agrees,
                "note": f"{item.note}; kind: {item.kind}" if item.note else f"kind: {item.kind}",
            }
            for item in reproduction.items
        ],
        "in_short": list(in_short(reproduction)),
    }


def as_table(reproduction: Reproduction) -> Table:
    """Return all statements as one table for terminals: numbers and verdicts without notes."""
    return verdict_table(map(reproduction_row, reproduction.items))


def write(reproduction: Reproduction, folder: Path) -> list[Path]:
    """Write report, results, figures and recordings; each file whole or not at all.

    Parameters
    ----------
    reproduction
        What was reproduced.
    folder
        Folder to write to; made where it does not exist.

    Returns
    -------
    list of Path
        The report first, then ``results.json``, then the figures, then the recordings.

    Raises
    ------
    FileError
        When the folder cannot be made or written to.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        reason = error.strerror or str(error)
        raise FileError(f"cannot make the output folder {folder}: {reason}") from None
    text = json.dumps(as_json(reproduction), indent=2, allow_nan=False)
    report = write_report(reproduction, folder / "report.html")
    results = write_bytes(folder / "results.json", (text + "\n").encode())
    figures = [save_figure(e.figure, folder / f"{_stem(e.name)}.png") for e in reproduction.figures]
    kept = [
        write_recording(recording, folder / f"{_stem(name)}.nc")
        for name, recording in reproduction.recordings.items()
    ]
    return [report, results, *figures, *kept]


def _number(value: float | None) -> float | None:
    return value if value is not None and math.isfinite(value) else None


def _stem(name: str) -> str:
    """Return the name of a file, without what file systems dislike."""
    return re.sub(r"[^A-Za-z0-9.-]+", "-", name)
