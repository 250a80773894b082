"""The instants of a measured signal: from a column of the file, or from a sample rate."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bywire.core.errors import FileError
from bywire.data.column_units import convert_in_place, unit_of
from bywire.data.file_format import Source
from bywire.data.mapping import Clock

_BLOCK = 1 << 20  # instants that are looked at together: their differences take memory


@dataclass(frozen=True)
class AxisKey:
    """What tells one time axis from another.

    Parameters
    ----------
    clock
        Where the instants come from.
    length
        How many samples there are.
    delay
        By how much the instants are moved back [s].
    """

    clock: Clock
    length: int
    delay: float


def instants(
    file: Path, source: Source, key: AxisKey, column: NDArray[np.float64] | None
) -> NDArray[np.float64]:
    """Return the instants of an axis [s], shape ``(sample,)``; they increase.

    Parameters
    ----------
    file, source
        What errors name.
    key
        The axis.
    column
        Numbers of the clock's column as read, which become the instants; None for a rate.

    Raises
    ------
    FileError
        When instants are missing or do not increase, with the place; when they are too few or
        not as many as samples.
    """
    clock = key.clock
    if column is None:
        time = np.arange(key.length, dtype=np.float64)
        time /= clock.rate
        time += clock.start - key.delay
    else:
        if column.size != key.length:
            raise FileError(
                f"{file}: {column.size} instants in {clock.column!r} for signals of {key.length} "
                "samples: choose the right time for each in a mapping, as "
                '[signals.NAME] time = { column = "t" }'
            )
        time = _measured(file, source, clock, column)
        if key.delay:
            time -= key.delay
    if time.size < 2:
        raise FileError(f"{file} has too few rows, {time.size}: two at least are needed")
    return time


def _measured(
    file: Path, source: Source, clock: Clock, column: NDArray[np.float64]
) -> NDArray[np.float64]:
    # A slower clock beside a faster one ends earlier; what follows is blank.
    time = column[: _filled(column)]
    bad = first_not_increasing(time)
    if bad is not None:
        where = f"{file}, column {clock.column!r}, {source.place(clock.column, bad)}"
        now, before = float(time[bad]), float(time[bad - 1]) if bad else np.nan
        if np.isfinite(now):
            what = "is repeated" if now == before else f"comes after {before:.10g}"
            fix = "time must increase: sort the rows, remove repeated ones"
        else:
            what, fix = "is no instant", "remove the row"
        raise FileError(f"{where}: {now:.10g} {clock.unit} {what}: {fix}")
    convert_in_place(time, unit_of(clock.unit), "s")
    return time


def _filled(column: NDArray[np.float64]) -> int:
    """Return how many numbers there are up to the last one that is not NaN."""
    end = column.size
    while end:
        begin = max(0, end - _BLOCK)
        there = np.flatnonzero(~np.isnan(column[begin:end]))
        if there.size:
            return begin + int(there[-1]) + 1
        end = begin
    return 0


def first_not_increasing(time: NDArray[np.float64]) -> int | None:
    """Return the first index whose instant does not come after the one before, None if all do."""
    if time.size and not np.isfinite(time[0]):
        return 0
    for begin in range(0, time.size - 1, _BLOCK):
        part = time[begin : begin + _BLOCK + 1]
        bad = np.flatnonzero(~(np.diff(part) > 0) | ~np.isfinite(part[1:]))
        if bad.size:
            return begin + int(bad[0]) + 1
    return None
