"""Read the folder that ``bywire run --out`` wrote: recordings, key figures, verdicts."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bywire.bench.kpis.kpi import Kpi
from bywire.bench.requirements import Verdict, read_limit
from bywire.core.callers import option
from bywire.core.errors import FileError, InputError
from bywire.core.scratch import require_finished
from bywire.data.netcdf import read_recording

if TYPE_CHECKING:
    import xarray as xr

RECORD = "result.json"
"""file in a result folder that describes the folder's content"""


@dataclass(frozen=True)
class FolderResult:
    """Result of a bench, read from a folder.

    Parameters
    ----------
    name
        Name of the bench.
    recordings
        One dataset per run of the experiment, by label.
    kpis, verdicts
        Key figures, and verdicts on the requirements.
    status
        ``passed`` or ``failed``.
    warnings
        Warnings of the run.
    changes
        Changes by name: the value, the original value, and the original value's source.
    """

    name: str
    recordings: Mapping[str, xr.Dataset]
    kpis: tuple[Kpi, ...]
    verdicts: tuple[Verdict, ...]
    status: str
    warnings: tuple[str, ...] = ()
    changes: Mapping[str, Mapping[str, str]] = field(default_factory=dict)


def is_result_folder(path: Path) -> bool:
    """Return whether a path is a folder with the record of a result."""
    return (path / RECORD).is_file()


def read_result(folder: Path) -> FolderResult:
    """Read a result folder into memory.

    Raises
    ------
    FileError
        When the folder is not a result folder or is incomplete, or a file is damaged or missing.
    """
    record = record_of(folder)
    try:
        status = str(record["status"])
        if status == "interrupted":
            raise FileError(
                f"{folder} is incomplete because its run was interrupted. {_again()}",
                name=str(folder),
            )
        kpis = tuple(_kpi(name, each) for name, each in record["kpis"].items())
        verdicts = tuple(_verdict(each) for each in record["requirements"])
        # File names without their folder: the folder may have moved since.
        files = [folder / Path(str(text)).name for text in record["files"]]
        name = str(record["bench"])
        warned = tuple(map(str, record.get("warnings", ())))
        changes = {
            str(name): {key: str(each[key]) for key in ("value", "instead_of", "of")}
            for name, each in record.get("changes", {}).items()
        }
    except (AttributeError, InputError, KeyError, TypeError, ValueError) as error:
        raise FileError(
            f"{folder / RECORD} is damaged ({type(error).__name__}: {error}). {_again()}",
            name=str(folder / RECORD),
        ) from None
    recordings = {path.stem: _recording(path) for path in files if path.suffix == ".nc"}
    if not recordings:
        raise FileError(
            f"{folder / RECORD} does not list any recording. {_again()}",
            name=str(folder / RECORD),
        )
    return FolderResult(name, recordings, kpis, verdicts, status, warned, changes)


def kpi_record(kpi: Kpi) -> dict[str, Any]:
    """Return a key figure for JSON, in which infinite and unknown errors become null."""
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
    """Return a verdict for JSON."""
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
    """Return the record of a result folder, without its recordings.

    Raises
    ------
    FileError
        When the folder is not a result folder or is incomplete, or its record is damaged.
    """
    path = folder / RECORD
    if not folder.is_dir():
        raise FileError(f"{folder} is not a folder. Check the path", name=str(folder))
    require_finished(folder)
    if not path.is_file():
        raise FileError(
            f"{folder} is not a complete result of bywire run: {RECORD} is missing. {_again()}",
            name=str(folder),
        )
    try:
        record = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise FileError(f"{path} cannot be read ({error}). {_again()}", name=str(path)) from None
    if not isinstance(record, dict):
        raise FileError(
            f"{path} is damaged: it does not contain a JSON object. {_again()}", name=str(path)
        )
    return record


def _recording(path: Path) -> xr.Dataset:
    if not path.is_file():
        raise FileError(
            f"{path.parent} is damaged: {path.name} is missing. {_again()}", name=str(path)
        )
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
    """Return a number from a JSON object; NaN for null."""
    return math.nan if value is None else float(value)


def _again() -> str:
    return f"Rerun the bench with {option('out')}, or specify another folder"
