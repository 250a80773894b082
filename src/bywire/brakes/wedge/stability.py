"""Stability of the wedge brake: motors without control, locked, and in the moment loop."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from bywire.analysis.locus import Border, locus
from bywire.analysis.loop_figures import LoopFigures
from bywire.brakes.wedge.elements import wedge
from bywire.brakes.wedge.linear import full, mechanical, rigid_rate
from bywire.brakes.wedge.loops.moment import LOOP
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.brakes.wedge.sizing.design import redesigned
from bywire.core.errors import InputError

_POINTS = 200  # frequencies of a disk margin
_LOWEST = 0.05  # Hz
_SPAN = 1.5  # a border is looked for between the neutral point over and times this
_EXACT = 1e-9
_FREE = 1e-12  # of the largest coupling: less is rounding


class Motion(NamedTuple):
    """Slow motion of the wedge with its motors, and that of the wedge alone.

    Parameters
    ----------
    growth, frequency
        Largest growth rate [1/s] with the motors at constant currents, and its frequency [Hz].
    rigid
        The same rate by the closed form of a rigid heart without damping [1/s]; 0 below neutral.
    locked
        Largest growth rate with locked motors [1/s].
    """

    growth: float
    frequency: float
    rigid: float
    locked: float


class Controlled(NamedTuple):
    """The closed moment loop.

    Parameters
    ----------
    disk
        Disk margin; NaN where it is unstable.
    unstable
        1 where it is unstable, else 0; NaN where there is no operating point.
    """

    disk: float
    unstable: float


def brake(
    par: WedgeParameters, mu_B: float, tan_alpha: float, known: bool = False
) -> WedgeParameters:
    """Return the brake with another wedge and other pads; its controllers know the wedge.

    ``mu_B``, ``tan_alpha``: friction coefficient of the pads and slope of the wedge; ``known``:
    whether the moment controller knows the friction coefficient too.
    """
    redesign = redesigned(par, tan_alpha, par.screw.lead)
    slope = redesign.control.moment.slope_hat
    if known:
        slope *= mu_B / par.wedge.mu_B
    return redesign.replace({"wedge.mu_B": mu_B, "control.moment.slope_hat": slope})


def motion(par: WedgeParameters, F_N: float) -> Motion:
    """Return how the wedge moves without control at a normal force [N], friction removed.

    Raises
    ------
    InputError
        When there is no operating point.
    """
    whole = mechanical(full(par, F_N))
    # Where the force exceeds the preload, one motor stands free: nothing depends on its angle.
    acting = np.abs(whole.A).max(axis=0) > _FREE * np.abs(whole.A).max()
    bound = whole.reduced(
        [n for n, acts in zip(whole.states, acting, strict=True) if acts], held=True
    )
    # The one that grows fastest; rounded, so that of a pair the upper one is taken every time.
    slow = max(bound.poles(), key=lambda s: (round(s.real, 9), s.imag))
    locked = whole.reduced(("x", "v"), held=True).poles()
    return Motion(
        float(slow.real),
        float(abs(slow.imag)) / (2.0 * math.pi),
        rigid_rate(par).real,
        float(locked.real.max()),
    )


def neutral(par: WedgeParameters, F_N: float) -> float:
    r"""Return the friction coefficient at which the wedge without control turns unstable.

    The closed form of the neutral point is :math:`\mu_B = \tan\alpha`.

    Parameters
    ----------
    par
        Brake; its own friction coefficient does not matter.
    F_N
        Normal force [N].

    References
    ----------
    Roberts et al. (2003), section "Introduction".
    """
    from scipy.optimize import brentq

    tan = wedge.slope(par.wedge)

    def growth(mu_B: float) -> float:
        return motion(par.replace({"wedge.mu_B": mu_B}), F_N).growth

    return float(brentq(growth, tan / _SPAN, tan * _SPAN, xtol=_EXACT))


def controlled(par: WedgeParameters, moment: float) -> Controlled:
    """Return stability and disk margin of the closed moment loop at a moment [N m].

    All NaN where the brake cannot be held at the moment.
    """
    try:
        gain, closed = LOOP.gain_and_closed(par, moment)
    except InputError:
        return Controlled(math.nan, math.nan)
    if not closed.is_stable:
        return Controlled(math.nan, 1.0)
    figures = LoopFigures(gain, closed, _POINTS, lowest=_LOWEST)
    return Controlled(figures.disk_margin, 0.0)


def moment_borders(
    par: WedgeParameters, moment: float, between: tuple[float, float], count: int
) -> tuple[Border, ...]:
    """Return the friction coefficients at which the closed moment loop changes its stability.

    Parameters
    ----------
    par
        Brake; its controller keeps what it believes.
    moment
        Operating point [N m].
    between, count
        Range of friction coefficients that is searched, and into how many values it is cut.

    Raises
    ------
    InputError
        When an operating point does not exist.
    """
    values = [float(value) for value in np.geomspace(*between, count)]
    return locus(LOOP, par, moment, "wedge.mu_B", "1", values).borders
