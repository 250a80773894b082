"""Bandwidth, crossover and phase margin of frequency responses."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

Array = NDArray[np.float64]
Response = Callable[[Array], NDArray[np.complex128]]

_NEARLY_ZERO = 1.0  # phase [degree] at the lower end that still counts as 0: a loop of finite gain
_POINTS = 4000  # of the grid that brackets the crossings, per call


@dataclass(frozen=True)
class Margin:
    """Stability margin of an open loop.

    Parameters
    ----------
    crossover
        Highest frequency at which the loop gain is 1 [Hz]; NaN where it never is.
    phase
        Smallest phase margin of all frequencies at which the loop gain is 1 [degree]; NaN likewise.
    at
        Frequency at which that is read [Hz]; NaN likewise.
    """

    crossover: float
    phase: float
    at: float = math.nan


def bandwidth(response: Response, band: tuple[float, float], drop: float = math.sqrt(0.5)) -> float:
    """Return the lowest frequency [Hz] at which a response has fallen to a share of its start.

    Parameters
    ----------
    response
        ``response(frequencies [Hz]) -> complex``.
    band
        Frequencies to look at [Hz]; the response at the lower one counts as 1.
    drop
        The share: -3 dB by default.

    Returns
    -------
    float
        NaN where the response stays above it.
    """
    level = drop * float(np.abs(response(np.array([band[0]])))[0])

    def excess(f: float) -> float:
        return float(np.abs(response(np.array([f])))[0]) - level

    grid = np.geomspace(*band, _POINTS)
    below = np.flatnonzero(np.abs(response(grid)) < level)
    if below.size == 0:
        return math.nan
    return float(brentq(excess, grid[below[0] - 1], grid[below[0]]))


def margin(loop: Response, band: tuple[float, float]) -> Margin:
    """Return crossover and phase margin of an open loop (negative feedback not counted).

    The phase is followed without jumps from the band's lower end, where it counts as the value
    between -360 and 0 degree: a loop with integral action begins near -90. Of several frequencies
    at which the gain is 1, falling or rising, the one nearest to -1 has the phase margin.

    Parameters
    ----------
    loop
        ``loop(frequencies [Hz]) -> complex``.
    band
        Frequencies to look at [Hz].
    """
    grid = np.geomspace(*band, _POINTS)
    values = loop(grid)
    above = np.abs(values) >= 1.0
    passes = np.flatnonzero(above[:-1] != above[1:])
    falls = [int(k) for k in passes if above[k]]
    if not falls:
        return Margin(math.nan, math.nan)

    def excess(f: float) -> float:
        return float(np.abs(loop(np.array([f])))[0]) - 1.0

    found = {}
    for k in map(int, passes):
        f = float(brentq(excess, grid[k], grid[k + 1]))
        path = np.append(values[: k + 1], loop(np.array([f])))
        phase = np.degrees(np.unwrap(np.angle(path)))
        turns = 360.0 * math.ceil((phase[0] - _NEARLY_ZERO) / 360.0)
        found[k] = f, 180.0 + float(phase[-1] - turns)
    at, smallest = min(found.values(), key=lambda one: abs((one[1] + 180.0) % 360.0 - 180.0))
    return Margin(found[falls[-1]][0], smallest, at)
