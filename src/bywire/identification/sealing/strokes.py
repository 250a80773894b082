"""Strokes of a piston: where it crosses a stretch of its travel one way without turning back."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bywire.core.typing import Array
from bywire.identification.differentiation import low_passed

_CROSSED = 0.8  # of the stretch that a stroke has to cross


@dataclass(frozen=True)
class Stroke:
    """One crossing.

    Parameters
    ----------
    direction
        1 outward, -1 inward.
    rows
        Samples in it that slide, of the record.
    """

    direction: int
    rows: NDArray[np.intp]


def velocity(x: Array, interval: float, cutoff: float) -> Array:
    """Return the velocity of a measured travel, low-passed; gaps are bridged straight.

    Parameters
    ----------
    x
        Travel [m], shape (n,); NaN in gaps.
    interval, cutoff
        Sample time [s] and corner frequency [Hz].
    """
    there = np.isfinite(x)
    at = np.arange(x.size)
    whole = x if there.all() else np.interp(at, at[there], x[there])
    return np.gradient(low_passed(whole, interval, cutoff), interval)


def find_strokes(x: Array, v: Array, low: float, high: float, slowest: float) -> list[Stroke]:
    """Return the strokes through a stretch of travel.

    Parameters
    ----------
    x, v
        Travel [m] and velocity [m/s], shape (n,).
    low, high
        The stretch [m].
    slowest
        Slower samples stick, creep or turn round, and do not count [m/s].
    """
    inside = np.isfinite(x) & (x > low) & (x < high)
    edges = np.flatnonzero(np.diff(np.concatenate(([0], inside.astype(int), [0]))))
    found = []
    for begin, end in edges.reshape(-1, 2).tolist():
        travel = float(x[end - 1] - x[begin])
        if abs(travel) < _CROSSED * (high - low):
            continue
        direction = 1 if travel > 0 else -1
        rows = begin + np.flatnonzero(direction * v[begin:end] > slowest)
        if rows.size:
            found.append(Stroke(direction, rows))
    return found
