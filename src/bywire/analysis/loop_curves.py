"""Loop gains over frequency, with their margins: what Nyquist and Nichols charts show."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from bywire.analysis.crossings import NEARLY_ZERO
from bywire.analysis.loop import Loop
from bywire.analysis.loop_figures import LoopFigures
from bywire.analysis.margins import LoopMargins, margins_of
from bywire.core.errors import ParameterError
from bywire.core.typing import Array, Complex

_BELOW = 30.0  # by so much a chart begins below the band of the loop
_POINTS = 1500


@dataclass(frozen=True, eq=False)
class LoopCurve:
    """Frequency response of a loop that is cut open, negative feedback not counted.

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
    """Curves of a loop over the values of a parameter; one curve where nothing is varied.

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
        """Index of the least disk margin; an unstable loop, or none, is worse than any."""
        disks = [c.margins.disk if c.margins.is_sound else -math.inf for c in self.curves]
        return int(np.argmin(disks))


@dataclass(frozen=True)
class Disk:
    """Circle on the real axis of the Nyquist plane that the loop gain stays out of.

    Parameters
    ----------
    middle, radius
        Of the circle; both infinite for the largest margin, where it is the left half plane.
    """

    middle: float
    radius: float


def disk(margin: float) -> Disk:
    r"""Return the circle that a loop gain of a disk margin touches.

    .. math:: \left|\frac{1 - L}{1 + L}\right| = \frac{2}{\alpha} \;\Leftrightarrow\;
        \left|L + \frac{1 + a^2}{1 - a^2}\right| = \frac{2 a}{1 - a^2}, \quad a = \alpha/2

    Parameters
    ----------
    margin
        Disk margin :math:`\alpha`, symmetric (skew 0): above 0, at most 2.

    Raises
    ------
    ParameterError
        When it is not in that range.

    References
    ----------
    P. Seiler, A. Packard, P. Gahinet, "An Introduction to Disk Margins", IEEE Control Systems
    Magazine 40(5), 2020: the symmetric margin, drawn in the Nyquist plane.
    """
    if not 0.0 < margin <= 2.0:
        raise ParameterError(f"disk margin = {margin:g}: it must be > 0 and <= 2")
    a = 0.5 * margin
    if a == 1.0:  # |S - T| = 1 at the imaginary axis: the circle has become a line
        return Disk(-math.inf, math.inf)
    return Disk(-(1.0 + a * a) / (1.0 - a * a), 2.0 * a / (1.0 - a * a))


def loop_curve(loop: Loop, figures: LoopFigures, points: int = _POINTS) -> LoopCurve:
    """Return the loop gain at an operating point, up to half its sampling frequency.

    Parameters
    ----------
    loop
        The loop, whose band a chart shows.
    figures
        Its figures there, see `margins.figures_at`.
    points
        Number of frequencies n.
    """
    margins = margins_of(figures)
    shown = replace(figures, points=points, lowest=loop.band[0] / _BELOW)
    return LoopCurve(shown.frequencies, shown.L, margins)
