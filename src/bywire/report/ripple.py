"""A ripple too fast to be seen as a line: the band that it fills, and the average inside it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from bywire.bench.kpis.smoothing import smoothed
from bywire.core.typing import Array
from bywire.report.channel import Channel
from bywire.report.decimation import COLUMNS, decimate

FASTEST = 3 * COLUMNS
"""points of a thinned line beyond which most pixel columns hold a whole wave of the ripple"""


def is_band(shown: Channel) -> bool:
    """Return whether a line through all samples fills an area."""
    kept = len(decimate(shown.time, shown.values)[0])
    return FASTEST < kept < len(shown.values)


def averaging_time(time: Array) -> float:
    """Return 1, 2 or 5 times a power of ten [s], at least one pixel column wide.

    Examples
    --------
    >>> averaging_time(np.array([0.0, 50.0]))
    0.1
    """
    column = float(time[-1] - time[0]) / COLUMNS
    decade = 10.0 ** math.floor(math.log10(column))
    return round(next(k * decade for k in (1.0, 2.0, 5.0, 10.0) if k * decade >= column), 12)


def inside(shown: Channel) -> tuple[Channel, float] | None:
    """Return the moving average and its averaging time [s] where a line fills an area."""
    if not is_band(shown) or not bool(np.all(np.isfinite(shown.values))):
        return None
    width = averaging_time(shown.time)
    return replace(shown, values=smoothed(shown.time, shown.values, width)), width
