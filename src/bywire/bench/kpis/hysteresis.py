r"""Hysteresis of a brake: the loop of drive (current) and response (pressure).

The loop is one slow cycle of the drive, for example the ramp of eq. (17) of Dardanelli, Alli,
Savaresi (2010). Its *apply* branch runs from the minimum to the maximum response, and its *release*
branch runs back. At any response, the width is the drive of the apply branch minus that of the
release branch, which is twice the friction as a current. Widths and area are positive when friction
dissipates, and negative for a loop in the opposite direction.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from bywire.bench.kpis.kpi import Undefined, measure
from bywire.bench.kpis.samples import defect, signal, smoothed, treatment
from bywire.core.quantities import readable_unit
from bywire.core.typing import Array
from bywire.core.units import shown

if TYPE_CHECKING:
    import xarray as xr

_OPEN = 0.05  # of the drive's range: maximum distance between both ends of a closed loop
_LEFT = 0.01  # of the response's range: minimum residual at the end that a note mentions
_LEVELS = 401  # number of levels at which the width is computed, excluding both extremes


@dataclass(frozen=True)
class Setting:
    """Signals of the loop.

    Parameters
    ----------
    drive, response
        Names of the signals in the recording.
    smoothing
        Averaging time [s]; 0 for none.
    demand
        Signal whose maximum separates apply from release in plots; empty for the drive.
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
        Current and pressure, for example, shape ``(n,)`` each.
    drive_unit, response_unit
        Their SI units.
    treatment
        Note on the treatment of the samples.
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
        """Reason why no figure is defined."""
        broken = defect(self.t, self.drive, self.response)
        if broken:
            return broken
        span, height = float(np.ptp(self.drive)), float(np.ptp(self.response))
        if span == 0.0 or height == 0.0:
            constant = "the drive" if span == 0.0 else "the response"
            return f"{constant} is constant, so there is no loop"
        apart = abs(float(self.drive[-1] - self.drive[0]))
        if apart > _OPEN * span:
            return (
                f"the loop is open: the drive ends {apart:.3g} {self.drive_unit} away from its "
                "start. Record the release as well, or average out the dither"
            )
        loops = _cycles(self.response)
        if loops == 1:
            return ""
        return f"the recording contains {loops} loops. Trim it to one loop"

    @property
    def is_open(self) -> bool:
        """Whether no figure is defined because drive or response does not move."""
        return not (np.ptp(self.drive) and np.ptp(self.response))

    @property
    def note(self) -> str:
        """Note on the treatment of the samples, and on a residual response at the end."""
        left = abs(float(self.response[-1] - self.response[0]))
        parts = [self.treatment] if self.treatment else []
        if left > _LEFT * float(np.ptp(self.response)):
            unit = readable_unit(left, self.response_unit)
            distance = shown(float(f"{left:.3g}"), self.response_unit, unit)
            parts.append(
                f"the response ends {distance} away from its start, so a straight line closes the "
                "loop"
            )
        return "; ".join(parts)

    @cached_property
    def branches(self) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
        """Drive and response of the apply branch, then of the release branch."""
        first = int(np.argmin(self.response))
        x, y = np.roll(self.drive, -first), np.roll(self.response, -first)
        top = int(np.argmax(y))
        closing = slice(0, 1 if first else 0)  # a loop from its minimum may remain open
        x_release, y_release = (np.append(s[top:], s[closing]) for s in (x, y))
        return (x[: top + 1], y[: top + 1]), (x_release, y_release)


def select(recording: xr.Dataset, setting: Setting) -> Loop:
    """Return the loop.

    Raises
    ------
    UnknownNameError
        When the recording does not contain drive or response.
    """
    t, _ = signal(recording, "time")
    x, x_unit = signal(recording, setting.drive)
    y, y_unit = signal(recording, setting.response)
    x, y = smoothed(t, x, setting.smoothing), smoothed(t, y, setting.smoothing)
    return Loop(t, x, y, x_unit, y_unit, treatment(setting.smoothing))


@measure("drive")
def loop_width_mid(loop: Loop) -> float | Undefined:
    """Width of the loop, in units of the drive, at the middle of the response's range.

    Mean drive at the apply branch's crossings of that level minus the mean at the release branch's
    crossings, each interpolated between samples. Ripple makes a branch cross several times. The
    mean over the crossings reduces the effect of ripple; `smoothed` removes it.
    """
    middle = 0.5 * float(np.min(loop.response) + np.max(loop.response))
    width = float(widths(loop, np.array([middle]))[0])
    if math.isnan(width):
        return Undefined("the release ends above mid-height")
    return width


@measure("drive")
def loop_width_max(loop: Loop) -> float | Undefined:
    """Maximum width of the loop, in units of the drive.

    The width of largest magnitude at 401 evenly spaced levels within the response's range, each as
    in `loop_width_mid`. Levels that the release does not reach are left out. Ripple widens the loop
    by up to its peak-to-peak value.
    """
    levels = np.linspace(np.min(loop.response), np.max(loop.response), _LEVELS + 2)[1:-1]
    reached = [width for width in widths(loop, levels).tolist() if not math.isnan(width)]
    return max(reached, key=abs) if reached else Undefined("the response never falls again")


@measure("drive*response")
def loop_area(loop: Loop) -> float | Undefined:
    r"""Area of the closed loop of drive versus response.

    .. math:: W = \oint i \, dp = \sum_k \tfrac12 (i_k + i_{k+1}) (p_{k+1} - p_k)

    The sum runs around the loop; a straight line joins the last sample to the first. Ripple adds
    the areas of its own small loops.
    """
    x, y = loop.drive, loop.response
    return float(np.sum(0.5 * (x + np.roll(x, -1)) * (np.roll(y, -1) - y)))


def widths(loop: Loop, levels: Array) -> Array:
    """Return the drive of the apply branch minus that of the release branch, per level.

    Parameters
    ----------
    loop
        The loop, averaged over any dither.
    levels
        Levels of the response, ascending, shape (n,).

    Returns
    -------
    numpy.ndarray
        Shape (n,); NaN where a branch does not cross the level.
    """
    apply, release = (_mean_crossings(x, y, levels) for x, y in loop.branches)
    return np.asarray(apply - release)


def closed_above(loop: Loop, width: float, levels: Array) -> float:
    """Return the level from which a loop is narrower than a width, up to its top.

    Parameters
    ----------
    loop
        The loop.
    width
        Maximum width that is treated as closed, in the unit of the drive.
    levels
        Levels to check, ascending; levels that the loop does not cross are left out.

    Returns
    -------
    float
        The lowest level above which the loop is closed: the lowest crossed level if the loop is
        closed everywhere, NaN if it is open at its top.
    """
    gaps = widths(loop, levels)
    crossed = np.isfinite(gaps)
    wide = np.flatnonzero(crossed & (np.abs(gaps) > width))
    first = wide[-1] + 1 if wide.size else 0
    closed = np.flatnonzero(crossed[first:])
    return float(levels[first + closed[0]]) if closed.size else math.nan


def _mean_crossings(x: Array, y: Array, levels: Array) -> Array:
    """Return the mean drive at the crossings of each ascending level, NaN without a crossing."""
    reached = np.searchsorted(levels, y, side="right")  # number of levels up to each sample
    low = np.minimum(reached[1:], reached[:-1])
    count = np.abs(np.diff(reached))
    k = np.repeat(np.arange(count.size), count)
    level = np.arange(k.size) - np.repeat(np.cumsum(count) - count, count) + low[k]
    order = np.argsort(level, kind="stable")
    k, level = k[order], level[order]
    share = (levels[level] - y[k]) / (y[k + 1] - y[k])
    crossings = x[k] + share * (x[k + 1] - x[k])
    ends = np.searchsorted(level, np.arange(levels.size + 1))
    means = [
        float(np.mean(crossings[begin:end])) if end > begin else math.nan
        for begin, end in pairwise(ends.tolist())
    ]
    return np.array(means)


def _cycles(y: Array) -> int:
    """Return how often a closed curve rises from its lowest to its highest quarter."""
    low, high = np.quantile([np.min(y), np.max(y)], [0.25, 0.75])
    marks = np.where(y <= low, -1, np.where(y >= high, 1, 0))
    marks = marks[marks != 0]
    return int(np.count_nonzero((marks == 1) & (np.roll(marks, 1) == -1)))
