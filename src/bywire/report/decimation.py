"""Fewer points for long lines, with every peak kept."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bywire.core.typing import Array

IntArray = NDArray[np.intp]

COLUMNS = 700
"""pixel columns of a figure on a screen: finer detail than this is not visible"""


def kept_samples(x: Array, y: Array, columns: int = COLUMNS) -> IntArray:
    """Return the positions of at most five samples per pixel column that draw the same line.

    Of every column the first, the lowest, the highest and the last sample stay, so that a line
    drawn through them covers the same pixels; a gap (NaN) stays a gap.

    ``x``: abscissa, not decreasing, shape ``(n,)``; ``y``: ordinate, shape ``(n,)``; ``columns``:
    pixel columns.

    Returns
    -------
    ndarray
        Positions of the samples that stay, ascending. Short lines stay whole.

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
    """Return the time spans in which a mode is active, no finer than the eye can tell.

    Parameters
    ----------
    time
        Time axis [s], shape ``(n,)``.
    active
        Whether the mode is active from this sample to the next, shape ``(n,)``.
    columns
        Pixel columns. Where there are more spans than half of them, a column counts as active
        when the mode is active for at least half of it.

    Returns
    -------
    list
        Start and end of every span [s], ascending, without overlap.
    """
    if len(time) < 2:
        return []
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
    padded = np.concatenate([[False], active, [False]]).astype(np.int8)
    change = np.diff(padded)
    starts = np.flatnonzero(change == 1)
    ends = np.minimum(np.flatnonzero(change == -1), len(time) - 1)
    return [
        (float(time[a]), float(time[b])) for a, b in zip(starts, ends, strict=True) if b > a
    ]
