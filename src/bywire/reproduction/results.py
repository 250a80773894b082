"""A reproduction as a table, as a JSON object, and as a folder of files."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from bywire.core.errors import FileError
from bywire.data.netcdf import write_recording
from bywire.report.files import write_bytes
from bywire.report.page import (
    Banner,
    Block,
    Details,
    FigureBlock,
    Paragraph,
    Section,
    TableBlock,
    write_page,
)
from bywire.report.tables import ReproductionRow, Table, reproduction_table
from bywire.reproduction.item import Item
from bywire.reproduction.reproduction import Reproduction

_BOUNDS = {"<=": "at most", ">=": "at least"}


def as_json(reproduction: Reproduction) -> dict[str, Any]:
    """Return the object that ``bywire reproduce --json`` prints.

    Returns
    -------
    dict
        ``{"source", "items": [{"id", "unit", "stated", "computed", "tolerance", "agrees",
        "note"}]}``. What is not stated, not computed or not defined is None; a tolerance is a
        number in the item's unit, or ``"<="`` or ``">="`` where the statement is a bound.
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
                "note": item.note,
            }
            for item in reproduction.items
        ],
    }


def as_table(reproduction: Reproduction) -> Table:
    """Return all statements as one table."""
    return _table(reproduction.items)


def write(reproduction: Reproduction, folder: Path) -> list[Path]:
    """Write report, results and recordings; each file whole or not at all.

    Parameters
    ----------
    reproduction
        What was reproduced.
    folder
        Folder to write to; made where it does not exist.

    Returns
    -------
    list of Path
        The report first, then ``results.json``, then the recordings.

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
    report = _page(reproduction, folder / "report.html")
    results = write_bytes(folder / "results.json", (text + "\n").encode())
    kept = [
        write_recording(recording, folder / f"{re.sub(r'[^A-Za-z0-9.-]+', '-', name)}.nc")
        for name, recording in reproduction.recordings.items()
    ]
    return [report, results, *kept]


def _page(reproduction: Reproduction, path: Path) -> Path:
    items = reproduction.items
    apart = [item for item in items if item.agrees is False]
    agreeing = sum(item.agrees is True for item in items)
    silent = len(items) - agreeing - len(apart)
    sections = [Section("Disagreements", [TableBlock(_table(apart))])] if apart else []
    for part in reproduction.parts:
        blocks: list[Block] = [Paragraph(part.text)]
        blocks += [FigureBlock(e.figure, e.caption) for e in part.exhibits]
        blocks += [TableBlock(_table(part.items))] if part.items else []
        blocks += [Details(title, [TableBlock(t)]) for title, t in part.appendix.items()]
        sections.append(Section(part.title, blocks))
    return write_page(
        path,
        f"Reproduction of {reproduction.source}",
        reproduction.citation,
        sections,
        banner=Banner(
            f"{agreeing} statements agree, {len(apart)} disagree; {silent} numbers are ours, "
            "quoted without a counterpart, or calibrated to the statement"
        ),
    )


def _table(items: Sequence[Item]) -> Table:
    return reproduction_table(
        ReproductionRow(
            id=item.id,
            stated=item.stated,
            computed=item.computed,
            unit=item.unit,
            tolerance=_BOUNDS.get(item.tolerance, "")
            if isinstance(item.tolerance, str)
            else item.tolerance,
            agrees=item.agrees,
            note=item.note,
        )
        for item in items
    )


def _number(value: float | None) -> float | None:
    return value if value is not None and math.isfinite(value) else None
