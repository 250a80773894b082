"""Variables of a recording, ready to draw: label, display unit and thinned values."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bywire.core.errors import ParameterError, unknown_name
from bywire.core.quantities import display_unit, readable_unit
from bywire.core.typing import Array
from bywire.core.units import convert
from bywire.report.wording import clean

if TYPE_CHECKING:
    import xarray as xr


@dataclass(frozen=True)
class Channel:
    """A variable in its display unit.

    Parameters
    ----------
    name
        Variable of the recording.
    label
        Its ``long_name``, or the name if the recording has none.
    symbol
        Its SI unit.
    unit
        Unit of ``values``.
    time
        Time axis [s], shape ``(n,)``.
    values
        Samples, shape ``(n,)``.
    """

    name: str
    label: str
    symbol: str
    unit: str
    time: Array
    values: Array


def channel(recording: xr.Dataset, name: str, unit: str = "") -> Channel:
    """Return a variable of a recording in a unit; by default its display unit.

    Raises
    ------
    UnknownNameError
        When the recording has no such variable.
    ParameterError
        When it has no samples, or more dimensions than time.
    """
    if name not in recording.data_vars:
        raise unknown_name("variable", name, map(str, recording.data_vars))
    array = recording[name]
    if array.dims != ("time",):
        raise ParameterError(
            f"{name} has the dimensions {', '.join(map(str, array.dims)) or 'none'}. A figure "
            "needs only time. Select one case first, for example recording.isel(case=0)",
            name=name,
            value=", ".join(map(str, array.dims)),
            valid="time",
        )
    if array.size == 0:
        raise ParameterError(f"{name} has no samples to draw", name=name)
    symbol = str(array.attrs.get("units", "1"))
    unit = unit or display_unit(symbol)
    return Channel(
        name=name,
        label=clean(array.attrs.get("long_name", name)),
        symbol=symbol,
        unit=unit,
        time=np.asarray(recording["time"].values, dtype=np.float64),
        values=convert(np.asarray(array.values, dtype=np.float64), symbol, unit),
    )


def size_of(values: Array) -> float:
    """Return the maximum magnitude of the finite values; 0 if there are none.

    Examples
    --------
    >>> size_of(np.array([1.0, -3.0, np.nan])), size_of(np.array([]))
    (3.0, 0.0)
    """
    return float(np.max(np.abs(values[np.isfinite(values)]), initial=0.0))


def axis_unit(recordings: Iterable[xr.Dataset], *names: str) -> str:
    """Return the most readable unit for the axis of some variables; see `readable_unit`.

    Variables that a recording does not contain are omitted.
    """
    drawn = [each[name] for each in recordings for name in names if name in each.data_vars]
    size = max(
        (size_of(np.asarray(array.values, dtype=np.float64)) for array in drawn), default=0.0
    )
    return readable_unit(size, str(drawn[0].attrs.get("units", "1"))) if drawn else ""


# --- Fewer points for long lines, with every peak kept

IntArray = NDArray[np.intp]

COLUMNS = 700
"""pixel columns of a figure on a screen: finer detail is not visible"""


def kept_samples(x: Array, y: Array, columns: int = COLUMNS) -> IntArray:
    """Return the positions of at most five samples per pixel column that draw the same line.

    Every column keeps its first, lowest, highest and last sample, so a line through them covers the
    same pixels. A gap (NaN) remains a gap.

    ``x``: abscissa, not decreasing, shape ``(n,)``; ``y``: ordinate, shape ``(n,)``; ``columns``:
    pixel columns.

    Returns
    -------
    ndarray
        Positions of the remaining samples, in ascending order. Short lines keep all samples.

    References
    ----------
    U. Jugel et al., "M4: a visualization-oriented time series data aggregation", Proc. VLDB
    Endowment 7 (10), 2014.
    """
    if len(x) <= 4 * columns:
        return np.arange(len(x), dtype=np.intp)
    column = _columns(x, columns)
    starts = np.flatnonzero(np.diff(column, prepend=-1))
    ends = np.append(starts[1:], len(x)) - 1
    gaps = np.isnan(y)
    lowest = _first_of_each(column, np.where(gaps, np.inf, y))
    highest = _first_of_each(column, np.where(gaps, np.inf, -y))
    gap = np.flatnonzero(gaps)
    gap = gap[np.diff(column[gap], prepend=-1) > 0]
    return np.unique(np.concatenate([starts, lowest, highest, ends, gap]))


def decimate(x: Array, y: Array, columns: int = COLUMNS) -> tuple[Array, Array]:
    """Return the points of :func:`kept_samples`."""
    kept = kept_samples(x, y, columns)
    return x[kept], y[kept]


def phases(
    time: Array, active: NDArray[np.bool_], columns: int = COLUMNS
) -> list[tuple[float, float]]:
    """Return the time spans in which a mode is active, at the resolution of the screen.

    Parameters
    ----------
    time
        Time axis [s], shape ``(n,)``.
    active
        Whether the mode is active from this sample to the next, shape ``(n,)``.
    columns
        Pixel columns. If there are more spans than half of them, a column is treated as active
        when the mode is active for at least half of it.

    Returns
    -------
    list
        Start and end of every span [s], in ascending order and disjoint.
    """
    spans = _spans(time, active)
    if len(spans) <= columns // 2:
        return spans
    column = _columns(time, columns)
    lasting = np.diff(time, append=time[-1])
    share = np.bincount(column, lasting * active, columns) / np.maximum(
        np.bincount(column, lasting, columns), np.finfo(float).tiny
    )
    edges = np.linspace(time[0], time[-1], columns + 1)
    return _spans(edges, np.append(share >= 0.5, False))


@dataclass(frozen=True)
class Phase:
    """A time span in which a mode is active, or active repeatedly.

    ``start``, ``end``: times [s]; ``share``: fraction of the time in which the mode is active, 1
    if always.
    """

    start: float
    end: float
    share: float


def lasting_phases(
    time: Array, active: NDArray[np.bool_], columns: int = COLUMNS, near: int = 16
) -> list[Phase]:
    """Return the time spans in which a mode is active, with nearby spans merged.

    Parameters
    ----------
    time, active, columns
        As in `phases`.
    near
        Distance of two spans in pixel columns below which they are merged.
    """
    spans = _spans(time, active)
    if not spans:
        return []
    starts, ends = np.array(spans).T
    gap = near * float(time[-1] - time[0]) / columns
    first = np.concatenate(([0], 1 + np.flatnonzero(starts[1:] - ends[:-1] >= gap)))
    last = np.concatenate((first[1:] - 1, [len(spans) - 1]))
    lasting = np.add.reduceat(ends - starts, first)
    return [
        Phase(float(starts[a]), float(ends[b]), float(sum_ / (ends[b] - starts[a])))
        for a, b, sum_ in zip(first, last, lasting, strict=True)
    ]


def _columns(x: Array, columns: int) -> IntArray:
    span = x[-1] - x[0]
    if not span > 0:
        return np.zeros(len(x), dtype=np.intp)
    column: IntArray = ((x - x[0]) / span * columns).astype(np.intp)
    return np.minimum(column, columns - 1)


def _first_of_each(column: IntArray, key: Array) -> IntArray:
    """Return the position of the smallest key in every column."""
    order: IntArray = np.lexsort((key, column)).astype(np.intp)
    return order[np.flatnonzero(np.diff(column[order], prepend=-1))]


def _spans(time: Array, active: NDArray[np.bool_]) -> list[tuple[float, float]]:
    if len(time) < 2:
        return []
    padded = np.concatenate([[False], active, [False]]).astype(np.int8)
    change = np.diff(padded)
    starts = np.flatnonzero(change == 1)
    ends = np.minimum(np.flatnonzero(change == -1), len(time) - 1)
    return [(float(time[a]), float(time[b])) for a, b in zip(starts, ends, strict=True) if b > a]
