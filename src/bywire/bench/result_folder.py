"""What ``bywire run --out`` left in a folder, read back: recordings, key figures, verdicts."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import xarray as xr

from bywire.bench.kpis.kpi import Kpi
from bywire.bench.requirements import Verdict, read_limit
from bywire.core.callers import option
from bywire.core.errors import FileError, InputError
from bywire.core.scratch import require_finished
from bywire.data.netcdf import read_recording

RECORD = "result.json"
"""file of a result folder that says what it holds"""


@dataclass(frozen=True)
class FolderResult:
    """What a folder holds of a bench that was run.

    Parameters
    ----------
    name
        What the bench was called.
    recordings
        One dataset per run of the experiment, by label.
    kpis, verdicts
        Key figures, and the requirements beside them.
    status
        ``passed`` or ``failed``.
    warnings
        What its run warned of.
    changes
        What was changed, by name: its value, what it is instead of, and of what.
    """

    name: str
    recordings: Mapping[str, xr.Dataset]
    kpis: tuple[Kpi, ...]
    verdicts: tuple[Verdict, ...]
    status: str
    warnings: tuple[str, ...] = ()
    changes: Mapping[str, Mapping[str, str]] = field(default_factory=dict)


def is_result_folder(path: Path) -> bool:
    """Return whether a path is a folder that says what bench left it."""
    return (path / RECORD).is_file()


def read_result(folder: Path) -> FolderResult:
    """Read a result folder into memory.

    Raises
    ------
    FileError
        When it is no result folder, is not finished, or something in it is damaged or missing.
    """
    record = record_of(folder)
    try:
        status = str(record["status"])
        if status == "interrupted":
            raise FileError(f"{folder} is not finished: its run was interrupted; {_again()}")
        kpis = tuple(_kpi(name, each) for name, each in record["kpis"].items())
        verdicts = tuple(_verdict(each) for each in record["requirements"])
        # Names alone, within the folder: it may have moved since.
        files = [folder / Path(str(text)).name for text in record["files"]]
        name = str(record["bench"])
        warned = tuple(map(str, record.get("warnings", ())))
        changes = {
            str(name): {key: str(each[key]) for key in ("value", "instead_of", "of")}
            for name, each in record.get("changes", {}).items()
        }
    except (AttributeError, InputError, KeyError, TypeError, ValueError) as error:
        raise FileError(
            f"{folder / RECORD} is damaged ({type(error).__name__}: {error}); {_again()}"
        ) from None
    recordings = {path.stem: _recording(path) for path in files if path.suffix == ".nc"}
    if not recordings:
        raise FileError(f"{folder / RECORD} names no recording; {_again()}")
    return FolderResult(name, recordings, kpis, verdicts, status, warned, changes)


def kpi_record(kpi: Kpi) -> dict[str, Any]:
    """Return what JSON says of a key figure, which has null for infinite and unknown errors."""
    return {
        "value": kpi.value,
        "unit": kpi.unit,
        "note": kpi.note,
        "error": kpi.error,
        "error_estimated": not math.isnan(kpi.error),
        "converges": kpi.converges,
        "open": kpi.is_open,
    }


def verdict_record(verdict: Verdict) -> dict[str, Any]:
    """Return what a JSON object says of a requirement."""
    return {
        "kpi": verdict.kpi,
        "limit": verdict.limit,
        "value": verdict.value,
        "unit": verdict.unit,
        "met": verdict.met,
        "outcome": verdict.outcome,
        "error": verdict.error,
    }


def record_of(folder: Path) -> dict[str, Any]:
    """Return what a result folder says it holds, without its recordings.

    Raises
    ------
    FileError
        When it is no result folder, is not finished, or its record is damaged.
    """
    path = folder / RECORD
    if not folder.is_dir():
        raise FileError(f"{folder} is no folder: check the path")
    require_finished(folder)
    if not path.is_file():
        raise FileError(
            f"{folder} is no finished result of bywire run: it has no {RECORD}; {_again()}"
        )
    try:
        record = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise FileError(f"{path} cannot be read ({error}); {_again()}") from None
    if not isinstance(record, dict):
        raise FileError(f"{path} is damaged: it holds no JSON object; {_again()}")
    return record


def _recording(path: Path) -> xr.Dataset:
    if not path.is_file():
        raise FileError(f"{path.parent} is damaged: {path.name} is missing; {_again()}")
    return read_recording(path)


def _kpi(name: str, record: Mapping[str, Any]) -> Kpi:
    error = _number(record.get("error"))
    if math.isnan(error) and record.get("error_estimated"):
        error = math.inf
    value, unit = _number(record["value"]), str(record["unit"])
    return Kpi(
        name,
        value,
        unit,
        "",
        str(record.get("note", "")),
        error,
        bool(record.get("open", False)),
        bool(record.get("converges", True)),
    )


def _verdict(record: Mapping[str, Any]) -> Verdict:
    return Verdict(
        read_limit(str(record["kpi"]), str(record["limit"]), str(record["unit"])),
        _number(record["value"]),
        bool(record["met"]),
        "",
        error=_number(record.get("error")),
        is_decided=record.get("outcome") != "undecided",
    )


def _number(value: Any) -> float:
    """Return a number of a JSON object, in which null stands for what is not defined."""
    return math.nan if value is None else float(value)


def _again() -> str:
    return f"run the bench again with {option('out')}, or name another folder"
