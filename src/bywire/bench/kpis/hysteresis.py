r"""Hysteresis of a brake: its loop of drive (current) and response (pressure).

The loop is one slow cycle of the drive, for instance the ramp of eq. (17) of Dardanelli, Alli,
Savaresi (2010). Its *apply* branch runs from the smallest to the largest response, its *release*
branch back. At a given response the width is the drive needed to apply less that at which the
brake releases: twice the friction, as a current. Widths and area are positive when friction
dissipates, negative for a loop run through the other way around.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
import xarray as xr

from bywire.bench.kpis.kpi import Undefined, measure
from bywire.bench.kpis.samples import defect, signal, smoothed, treatment
from bywire.core.typing import Array

_OPEN = 0.05  # of the drive's range: more than this between both ends is no closed loop
_LEFT = 0.01  # of the response's range: from here on a rest at the end is noted
_LEVELS = 401  # levels at which the width is looked up, both extremes left out


@dataclass(frozen=True)
class Setting:
    """What the loop is of.

    Parameters
    ----------
    drive, response
        Names of the signals in the recording.
    smoothing
        Averaging time [s]; 0 for none.
    demand
        Signal whose maximum divides applying from releasing in figures; empty for the drive.
    """

    drive: str
    response: str
    smoothing: float = 0.0
    demand: str = ""


@dataclass(frozen=True, eq=False)
class Loop:
    """Samples of one loop.

    Parameters
    ----------
    t
        Times [s], increasing, shape ``(n,)``.
    drive, response
        Current and pressure, for instance, shape ``(n,)`` each.
    drive_unit, response_unit
        Their SI units.
    treatment
        How the samples were treated.
    """

    t: Array
    drive: Array
    response: Array
    drive_unit: str = "A"
    response_unit: str = "Pa"
    treatment: str = ""

    @property
    def units(self) -> Mapping[str, str]:
        """Units of drive and of drive times response."""
        return {
            "drive": self.drive_unit,
            "drive*response": f"{self.drive_unit}*{self.response_unit}",
        }

    @cached_property
    def defect(self) -> str:
        """Why no figure is defined."""
        broken = defect(self.t, self.drive, self.response)
        if broken:
            return broken
        span, height = float(np.ptp(self.drive)), float(np.ptp(self.response))
        if span == 0.0 or height == 0.0:
            return f"{'the drive' if span == 0.0 else 'the response'} is constant: no loop"
        apart = abs(float(self.drive[-1] - self.drive[0]))
        if apart > _OPEN * span:
            return (
                f"the loop is open: the drive ends {apart:.3g} {self.drive_unit} away from its "
                "beginning; record the way back, or smooth the dither away"
            )
        loops = _cycles(self.response)
        return "" if loops == 1 else f"{loops} loops: cut the recording to one"

    @property
    def is_open(self) -> bool:
        """Whether no figure is defined because drive or response does not move."""
        return not (np.ptp(self.drive) and np.ptp(self.response))

    @property
    def note(self) -> str:
        """How the samples were treated, and what response is left at the end."""
        left = abs(float(self.response[-1] - self.response[0]))
        parts = [self.treatment] if self.treatment else []
        if left > _LEFT * float(np.ptp(self.response)):
            parts.append(
                f"the response ends {left:.3g} {self.response_unit} away from its beginning; "
                "a straight line closes the loop"
            )
        return "; ".join(parts)

    @cached_property
    def branches(self) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
        """Drive and response of the apply branch, then of the release branch."""
        first = int(np.argmin(self.response))
        x, y = np.roll(self.drive, -first), np.roll(self.response, -first)
        top = int(np.argmax(y))
        closing = slice(0, 1 if first else 0)  # a loop that begins at its foot may stay open there
        x_release, y_release = (np.append(s[top:], s[closing]) for s in (x, y))
        return (x[: top + 1], y[: top + 1]), (x_release, y_release)


def select(recording: xr.Dataset, setting: Setting) -> Loop:
    """Return the loop.

    Raises
    ------
    UnknownNameError
        When the recording does not hold drive or response.
    """
    t, _ = signal(recording, "time")
    x, x_unit = signal(recording, setting.drive)
    y, y_unit = signal(recording, setting.response)
    x, y = smoothed(t, x, setting.smoothing), smoothed(t, y, setting.smoothing)
    return Loop(t, x, y, x_unit, y_unit, treatment(setting.smoothing))


@measure("drive")
def loop_width_mid(loop: Loop) -> float | Undefined:
    """Width of the loop, as drive, at mid-height of the response's range.

    Mean drive of the apply branch's crossings of that level less the mean of the release
    branch's, each interpolated between samples. Ripple makes a branch cross several times: the
    mean over the crossings keeps its effect small; `smoothed` removes it.
    """
    middle = 0.5 * float(np.min(loop.response) + np.max(loop.response))
    (width,) = _widths(loop, np.array([middle]))
    if math.isnan(width):
        return Undefined("the release ends above mid-height")
    return width


@measure("drive")
def loop_width_max(loop: Loop) -> float | Undefined:
    """Width of the loop, as drive, where it is widest.

    The width of largest magnitude at 401 levels spread evenly inside the response's range,
    defined at each as in `loop_width_mid`, levels that the release does not reach
    left out. Ripple widens it by up to its peak to peak value.
    """
    levels = np.linspace(np.min(loop.response), np.max(loop.response), _LEVELS + 2)[1:-1]
    reached = [width for width in _widths(loop, levels) if not math.isnan(width)]
    return max(reached, key=abs) if reached else Undefined("the response never falls again")


@measure("drive*response")
def loop_area(loop: Loop) -> float | Undefined:
    r"""Area of the closed loop of drive over response.

    .. math:: W = \oint i \, dp = \sum_k \tfrac12 (i_k + i_{k+1}) (p_{k+1} - p_k)

    The sum runs around the loop; a straight line joins the last sample to the first. Ripple adds
    the areas of its own small loops.
    """
    x, y = loop.drive, loop.response
    return float(np.sum(0.5 * (x + np.roll(x, -1)) * (np.roll(y, -1) - y)))


def _widths(loop: Loop, levels: Array) -> list[float]:
    """Return the width of the loop at levels that rise."""
    apply, release = (_mean_crossings(x, y, levels) for x, y in loop.branches)
    return [a - b for a, b in zip(apply, release, strict=True)]


def _mean_crossings(x: Array, y: Array, levels: Array) -> list[float]:
    """Return the mean drive where a branch crosses each level, NaN where it does not."""
    reached = np.searchsorted(levels, y, side="right")  # how many levels a sample has reached
    low = np.minimum(reached[1:], reached[:-1])
    count = np.abs(np.diff(reached))
    k = np.repeat(np.arange(count.size), count)
    level = np.arange(k.size) - np.repeat(np.cumsum(count) - count, count) + low[k]
    order = np.argsort(level, kind="stable")
    k, level = k[order], level[order]
    share = (levels[level] - y[k]) / (y[k + 1] - y[k])
    crossings = x[k] + share * (x[k + 1] - x[k])
    ends = np.searchsorted(level, np.arange(levels.size + 1))
    return [
        float(np.mean(crossings[begin:end])) if end > begin else math.nan
        for begin, end in pairwise(ends.tolist())
    ]


def _cycles(y: Array) -> int:
    """Return how often the closed course rises from its lowest to its highest quarter."""
    low, high = np.quantile([np.min(y), np.max(y)], [0.25, 0.75])
    marks = np.where(y <= low, -1, np.where(y >= high, 1, 0))
    marks = marks[marks != 0]
    return int(np.count_nonzero((marks == 1) & (np.roll(marks, 1) == -1)))


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
