"""Margins of a loop at an operating point or over a range, and its gain over frequency."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from bywire.analysis.crossings import NEARLY_ZERO, lower_factor, margin_of, upper_factor
from bywire.analysis.loop import Loop
from bywire.analysis.loop_figures import LOOP_FIGURES, LoopFigure, LoopFigures
from bywire.core.errors import ParameterError, not_valid
from bywire.core.parameters import ParameterSet
from bywire.core.typing import Array, Complex
from bywire.core.undefined import EqualWhereUndefined

_SHOWN = (
    "gain_margin",
    "lower_gain_margin",
    "phase_margin",
    "crossover",
    "delay_margin",
    "disk_margin",
    "sensitivity_peak",
    "complementary_peak",
    "bandwidth",
)
MARGINS: Mapping[str, LoopFigure] = {
    figure.margin: figure for figure in (LOOP_FIGURES[name] for name in _SHOWN)
}
"""figures of `LoopMargins` in the order of their table"""
_POINTS = 2000


@dataclass(frozen=True, eq=False)
class LoopMargins(EqualWhereUndefined):
    """Margins of a sampled loop, including its delays and filters.

    They are NaN for an unstable loop, and without a loop.

    Parameters
    ----------
    gain
        Smallest factor above 1 that makes the loop unstable; inf if there is none.
    phase, crossover
        Minimum phase margin at all gain crossovers [degree], and the highest crossover [Hz].
    delay
        Additional dead time that the loop tolerates [s].
    disk
        Disk-based margin (symmetric, skew 0) for simultaneous changes of gain and phase; 0 to 2.
    sensitivity, complementary
        Maximum magnitudes of S = 1/(1 + L) and T = L/(1 + L).
    bandwidth
        Frequency at which the closed loop has fallen to -3 dB of its gain at rest [Hz].
    stable
        Whether the closed loop is stable.
    has_loop
        Whether there is feedback: with gains of 0, or a closed valve, there is no loop.
    lower_gain
        Largest factor below 1 that makes the loop unstable; 0 if there is none.
    phase_at
        Gain crossover of the phase margin [Hz].
    gain_at, lower_gain_at
        Frequencies of the two gain margins [Hz].
    corners
        As in `LinearModel`.
    """

    gain: float
    phase: float
    crossover: float
    delay: float
    disk: float
    sensitivity: float
    complementary: float
    bandwidth: float
    stable: bool
    has_loop: bool = True
    lower_gain: float = math.nan
    phase_at: float = math.nan
    gain_at: float = math.nan
    lower_gain_at: float = math.nan
    corners: tuple[str, ...] = ()

    @property
    def state(self) -> str:
        """``"stable"``, ``"unstable"``, or ``"no loop"``."""
        if not self.has_loop:
            return "no loop"
        return "stable" if self.stable else "unstable"

    @property
    def is_sound(self) -> bool:
        """Whether there is a stable loop, which has margins."""
        return self.stable and self.has_loop


NO_LOOP = "no loop: the loop gain is 0 at all frequencies"
"""note on a loop whose gains are 0, or whose valve is closed"""
UNSTABLE = LoopMargins(
    gain=math.nan,
    phase=math.nan,
    crossover=math.nan,
    delay=math.nan,
    disk=math.nan,
    sensitivity=math.nan,
    complementary=math.nan,
    bandwidth=math.nan,
    stable=False,
)
"""margins of an unstable loop"""


def figures_at(loop: Loop, par: ParameterSet, value: float) -> LoopFigures:
    """Return the figures of a loop at an operating point, without dry friction.

    Raises
    ------
    InputError
        When the operating point does not exist.
    """
    return LoopFigures(*loop.gain_and_closed(par, value), _POINTS, exact=True)


def margins_of(figures: LoopFigures) -> LoopMargins:
    """Return the margins of a loop from its figures."""
    corners = figures.gain.corners
    if not figures.has_loop:
        stable = figures.is_stable
        return replace(UNSTABLE, corners=corners, stable=stable, has_loop=False)
    if not figures.is_stable:
        return replace(UNSTABLE, corners=corners) if corners else UNSTABLE
    upper, lower = upper_factor(figures.factors), lower_factor(figures.factors)
    # Signed, although a design uses the distance from -1: below 0, the phase is beyond -180.
    margin = margin_of(figures.crossings)
    return LoopMargins(
        gain=upper.factor,
        lower_gain=lower.factor,
        phase=margin.phase,
        crossover=margin.crossover,
        delay=_or_nan(figures.delay_margin),
        disk=figures.disk_margin,
        sensitivity=figures.sensitivity_peak,
        complementary=figures.complementary_peak,
        bandwidth=_or_nan(figures.fall),
        stable=True,
        phase_at=margin.at,
        gain_at=upper.frequency,
        lower_gain_at=lower.frequency,
        corners=corners,
    )


def margins(loop: Loop, par: ParameterSet, value: float) -> LoopMargins:
    """Return the margins of a loop at an operating point; see `figures_at`."""
    return margins_of(figures_at(loop, par, value))


def worst(
    margins: Sequence[LoopMargins], values: Sequence[float]
) -> Mapping[str, tuple[float, float]]:
    """Return the worst of each margin, and the value at which it occurs.

    An unstable or missing loop, whose margins are NaN, is the worst.
    """
    if not margins:
        raise ParameterError("margins is empty. It needs at least one value", name="margins")
    result: dict[str, tuple[float, float]] = {}
    for field, figure in MARGINS.items():
        if field == "crossover":  # neither a larger nor a smaller one is better
            continue
        sense = -1.0 if figure.is_less_better else 1.0
        sizes = [sense * getattr(row, field) if row.is_sound else -math.inf for row in margins]
        k = int(np.nanargmin(sizes)) if not all(map(math.isnan, sizes)) else 0
        result[field] = (getattr(margins[k], field), float(values[k]))
    return result


def _or_nan(figure: float) -> float:
    return figure if math.isfinite(figure) else math.nan


# --- Loop gain versus frequency, for Nyquist and Nichols charts

_BELOW = 30.0  # ratio of the lower end of the loop's band to the lowest frequency of a chart
_CHART_POINTS = 1500


@dataclass(frozen=True, eq=False)
class LoopCurve:
    """Frequency response of a loop that is cut open, without the sign of negative feedback.

    Parameters
    ----------
    frequency
        Frequencies [Hz], ascending, shape (n,).
    L
        Loop gain, shape (n,).
    margins
        Margins of the loop.
    """

    frequency: Array
    L: Complex
    margins: LoopMargins

    @property
    def S(self) -> Complex:
        """Sensitivity 1/(1 + L), shape (n,)."""
        return np.asarray(1.0 / (1.0 + self.L))

    @property
    def T(self) -> Complex:
        """Complementary sensitivity L/(1 + L), shape (n,)."""
        return np.asarray(self.L / (1.0 + self.L))

    @property
    def phase(self) -> Array:
        """Phase [degree] without jumps, between -360 and 0 at the lowest frequency; shape (n,)."""
        phase = np.degrees(np.unwrap(np.angle(self.L)))
        return np.asarray(phase - 360.0 * math.ceil((phase[0] - NEARLY_ZERO) / 360.0))


@dataclass(frozen=True, eq=False)
class Family:
    """Curves of a loop over the values of a parameter; a single curve without variation.

    Parameters
    ----------
    curves
        One per value.
    name, unit
        Parameter and its SI unit; empty and ``"1"`` for a single curve.
    values
        Its values [SI].
    """

    curves: tuple[LoopCurve, ...]
    name: str = ""
    unit: str = "1"
    values: tuple[float, ...] = (math.nan,)

    @property
    def worst(self) -> int:
        """Index of the smallest disk margin; an unstable or missing loop is the worst."""
        disks = [c.margins.disk if c.margins.is_sound else -math.inf for c in self.curves]
        return int(np.argmin(disks))


@dataclass(frozen=True)
class Disk:
    """Circle on the real axis of the Nyquist plane, outside which the loop gain stays.

    Parameters
    ----------
    middle, radius
        Center and radius; both are infinite for the largest margin, the left half plane.
    """

    middle: float
    radius: float


def disk(margin: float) -> Disk:
    r"""Return the circle that a loop gain with a disk margin touches.

    .. math:: \left|\frac{1 - L}{1 + L}\right| = \frac{2}{\alpha} \;\Leftrightarrow\;
        \left|L + \frac{1 + a^2}{1 - a^2}\right| = \frac{2 a}{1 - a^2}, \quad a = \alpha/2

    Parameters
    ----------
    margin
        Disk margin :math:`\alpha`, symmetric (skew 0): above 0, at most 2.

    Raises
    ------
    ParameterError
        When the margin is not in this range.

    References
    ----------
    P. Seiler, A. Packard, P. Gahinet, "An Introduction to Disk Margins", IEEE Control Systems
    Magazine 40(5), 2020: the symmetric margin, drawn in the Nyquist plane.
    """
    if not 0.0 < margin <= 2.0:
        raise not_valid("disk margin", f"{margin:g}", "> 0 and <= 2")
    a = 0.5 * margin
    if a == 1.0:  # |S - T| = 1 at the imaginary axis: the circle has become a line
        return Disk(-math.inf, math.inf)
    return Disk(-(1.0 + a * a) / (1.0 - a * a), 2.0 * a / (1.0 - a * a))


def loop_curve(loop: Loop, figures: LoopFigures, points: int = _CHART_POINTS) -> LoopCurve:
    """Return the loop gain at an operating point, up to half its sampling frequency.

    Parameters
    ----------
    loop
        The loop, whose band a chart shows.
    figures
        Its figures there; see `margins.figures_at`.
    points
        Number of frequencies n.
    """
    margins = margins_of(figures)
    shown = replace(figures, points=points, lowest=loop.band[0] / _BELOW)
    return LoopCurve(shown.frequencies, shown.L, margins)
