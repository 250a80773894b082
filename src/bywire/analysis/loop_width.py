"""How wide a hysteresis loop is at each level of its response, and from where on it is closed."""

from __future__ import annotations

import numpy as np

from bywire.bench.kpis.hysteresis import Loop
from bywire.core.typing import Array


def widths(loop: Loop, levels: Array) -> Array:
    """Return the drive needed to apply less that at which the brake releases, per level.

    Parameters
    ----------
    loop
        The loop, averaged over the dither if it has one.
    levels
        Levels of the response, shape (n,).

    Returns
    -------
    numpy.ndarray
        Shape (n,); NaN where a branch does not cross the level.
    """
    apply, release = (
        np.array([_mean_crossing(x, y, float(level)) for level in levels]) for x, y in loop.branches
    )
    return np.asarray(apply - release)


def closed_above(loop: Loop, width: float, levels: Array) -> float:
    """Return the level from which on a loop stays narrower than a width, up to its top.

    Parameters
    ----------
    loop
        The loop.
    width
        Largest width that counts as closed, in the unit of the drive.
    levels
        Levels to look at, ascending; those that the loop does not cross are left out.

    Returns
    -------
    float
        The lowest level that is closed with all above it: the lowest one crossed where the loop
        is closed everywhere, NaN where it is open at its top.
    """
    gaps = widths(loop, levels)
    crossed = np.isfinite(gaps)
    wide = np.flatnonzero(crossed & (np.abs(gaps) > width))
    first = wide[-1] + 1 if wide.size else 0
    closed = np.flatnonzero(crossed[first:])
    return float(levels[first + closed[0]]) if closed.size else float("nan")


def _mean_crossing(x: Array, y: Array, level: float) -> float:
    """Return the mean drive where a branch crosses a level, NaN where it does not."""
    above = y >= level
    k = np.flatnonzero(above[1:] != above[:-1])
    if k.size == 0:
        return float("nan")
    share = (level - y[k]) / (y[k + 1] - y[k])
    return float(np.mean(x[k] + share * (x[k + 1] - x[k])))
