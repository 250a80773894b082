"""ASAM MDF 4: groups of channels, each with its instants, read and written by asammdf."""

from __future__ import annotations

import contextlib
import logging
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bywire.core.errors import BywireError, FileError
from bywire.data.file_format import Column, FileFormat, Progress, ReadOptions, library
from bywire.data.mdf4_checks import require_sound

if TYPE_CHECKING:
    import xarray as xr

_NUMBERS = range(6)  # data types: integers and reals, either byte order
_VALUE, _MASTER, _VIRTUAL_MASTER, _VIRTUAL = 0, 2, 3, 6
_TEXTS = range(7, 12)  # conversions to and from texts
_TIME = 1  # what a master channel counts
# A file that is given by its path is mapped into memory: quick, and too much for large ones.
_MAPPED = 2**29  # bytes
_RECORDS = 1 << 20  # that are read at a time from a larger one
_WHAT = "MDF files"


class Mdf4Source:
    """An open MDF file; a name that several groups have gets the number of its group."""

    def __init__(self, path: Path, file: Any, formulas: set[int], records: int | None) -> None:
        self._path, self._file, self._records = path, file, records
        self._places: dict[str, tuple[int, int]] = {}
        self.columns: Mapping[str, Column] = self._columns(formulas)

    def read(self, names: Sequence[str], progress: Progress) -> dict[str, NDArray[np.float64]]:
        """Return the numbers of some channels; what is marked as invalid becomes NaN."""
        found = {name: np.empty(self.columns[name].length or 0) for name in names}
        total, done = sum(one.size for one in found.values()), 0
        for group in sorted({self._places[name][0] for name in names}):
            wanted = [name for name in names if self._places[name][0] == group]
            length = self._file.groups[group].channel_group.cycles_nr
            step = self._records or length
            for begin in range(0, length, step):
                end = min(begin + step, length)
                self._read_piece(group, {name: found[name][begin:end] for name in wanted}, begin)
                done += len(wanted) * (end - begin)
                progress(f"reading {self._path.name}", done / total)
        return found

    def place(self, name: str, row: int) -> str:
        """Return the record of a value."""
        return f"record {row}"

    def _columns(self, formulas: set[int]) -> dict[str, Column]:
        groups = self._file.groups
        uses = Counter(one.name for group in groups for one in group.channels)
        found: dict[str, Column] = {}
        for g, group in enumerate(groups):
            length = group.channel_group.cycles_nr
            master = self._file.masters_db.get(g)
            if master is None or not length or not _is_time(group.channels[master]):
                continue
            names = {
                c: one.name if uses[one.name] == 1 else f"{one.name}@{g}"
                for c, one in enumerate(group.channels)
                if _is_read(one, group.channel_dependencies[c], formulas)
            }
            if master not in names:
                continue
            for c, name in names.items():
                one = group.channels[c]
                unit = "s" if c == master else one.unit or getattr(one.conversion, "unit", "")
                unit = "1" if not unit and _has_texts(one) else unit
                clock = None if c == master else names[master]
                self._places[name] = (g, c)
                found[name] = Column(name, (unit or "").strip(), length, clock, "")
        return found

    def _read_piece(
        self, group: int, pieces: Mapping[str, NDArray[np.float64]], begin: int
    ) -> None:
        """Fill pieces of channels of one group, and of their instants, from a record on."""
        master = self._file.masters_db[group]
        indices = [self._places[name][1] for name in pieces]
        # With a channel of values come the instants; alone, they are a channel like any other.
        wanted = [(None, group, index) for index in indices if index != master]
        # Asked for a number of records, the library is slower by a third.
        count = None if self._records is None else len(next(iter(pieces.values())))
        signals = self._file.select(
            wanted or [(None, group, master)], record_offset=begin, record_count=count,
            copy_master=False, ignore_value2text_conversions=True, validate=False,
        )  # fmt: skip
        instants = signals[0].timestamps
        for (name, piece), index in zip(pieces.items(), indices, strict=True):
            signal = None if index == master else signals.pop(0)
            piece[:] = _numbers(self._path, name, instants if signal is None else signal.samples)
            if signal is not None and signal.invalidation_bits is not None:
                piece[np.asarray(signal.invalidation_bits, dtype=bool)] = np.nan


def _numbers(path: Path, name: str, values: Any) -> NDArray[Any]:
    array = np.asarray(values)
    if array.ndim != 1 or array.dtype.kind not in "iufb":
        raise FileError(f"{path}: channel {name!r} holds no numbers: leave it out")
    return array


def _is_time(master: Any) -> bool:
    return bool(master.sync_type == _TIME)


def _is_read(one: Any, parts: Any, formulas: set[int]) -> bool:
    """Return whether a channel holds numbers: no text, no array, nothing that is computed."""
    kinds = (_VALUE, _MASTER, _VIRTUAL_MASTER, _VIRTUAL)
    return (
        one.channel_type in kinds
        and one.data_type in _NUMBERS
        and not parts
        and one.address not in formulas
    )


def _silence(asammdf: Any) -> None:
    """Keep the library from speaking of a damaged file beside the one error that says so."""
    logging.getLogger("asammdf").setLevel(logging.CRITICAL + 1)
    kind = asammdf.blocks.mdf_v4.MDF4
    finish = getattr(kind, "__del__", None)
    if finish is None or getattr(finish, "is_quiet", False):
        return

    def quietly(file: Any) -> None:
        with contextlib.suppress(AttributeError):  # of what a failed constructor has not made
            finish(file)

    quietly.is_quiet = True  # type: ignore[attr-defined]
    kind.__del__ = quietly


def _has_texts(one: Any) -> bool:
    """Return whether a channel's numbers stand for texts; the numbers are what is read."""
    return getattr(one.conversion, "conversion_type", 0) in _TEXTS


@contextmanager
def _open(path: Path, options: ReadOptions) -> Iterator[Mdf4Source]:
    asammdf = library("asammdf", _WHAT)
    formulas = require_sound(path)
    _silence(asammdf)
    try:
        is_small = path.stat().st_size <= _MAPPED
        with path.open("rb") as stream, asammdf.MDF(path if is_small else stream) as file:
            yield Mdf4Source(path, file, formulas, None if is_small else _RECORDS)
    except (BywireError, MemoryError):
        raise
    except Exception as error:  # the library fails in as many ways as files can be damaged
        reason = "" if isinstance(error, LookupError) else " ".join(str(error).split())[:200]
        reason = reason or "its records cannot be read"
        raise FileError(
            f"{path} is a damaged MDF file ({reason}): copy it again, or repair it with the "
            "program that recorded it"
        ) from None


def _write(dataset: xr.Dataset, path: Path, progress: Progress) -> None:
    asammdf = library("asammdf", _WHAT)
    with asammdf.MDF(version="4.10") as file:
        for dim in dict.fromkeys(str(signal.dims[0]) for signal in dataset.data_vars.values()):
            time = np.asarray(dataset[dim].values, dtype=np.float64)
            signals = [
                asammdf.Signal(
                    samples=np.asarray(one.values), timestamps=time, name=str(name),
                    unit=str(one.attrs.get("units", "1")),
                )
                for name, one in dataset.data_vars.items()
                if one.dims[0] == dim
            ]  # fmt: skip
            file.append(signals, comment="bywire")
        progress(f"writing {path.name}", 0.5)
        file.save(path, overwrite=True, compression=0)
    progress(f"writing {path.name}", 1.0)


FORMAT = FileFormat(
    "mdf4", "an MDF file", (".mf4", ".mdf", ".dat"),
    lambda head: head[:3] == b"MDF" or head[:7] == b"UnFinMF", _open, _write, has_many_axes=True,
)  # fmt: skip
