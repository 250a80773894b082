"""A ramp from one level to another, a hold, and an optional ramp back."""

from __future__ import annotations

import math
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from bywire.bench.stimulus import Level
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import TimeConstant, Unit

LevelRate = Annotated[float, Unit("level/s"), Field(gt=0, allow_inf_nan=False)]


class Parameters(ParameterSet):
    """Piecewise linear signal, up or down."""

    start: Level
    """value before the ramp"""
    end: Level
    """value at the end of the ramp, above or below ``start``"""
    slope: LevelRate
    """magnitude of the slope, in both directions"""
    t_start: TimeConstant = 0.0
    """time at which the ramp begins"""
    t_hold: TimeConstant
    """time at ``end`` before the return ramp"""
    after: Literal["stay", "return"]
    """after the hold: ``stay`` at ``end`` or ``return`` to ``start``"""


def sample(t: NDArray[np.float64], par: Parameters) -> NDArray[np.float64]:
    r"""Return the ramp.

    .. math:: u = u_0 \pm \left( \mathrm{sat}_0^h(\dot u (t - t_0))
              - \mathrm{sat}_0^h(\dot u (t - t_1)) \right)

    with :math:`h = |u_1 - u_0|`; the return ramp begins at :math:`t_1`. Eq. (17) of
    Dardanelli, Alli, Savaresi (2010) is ``start = 0 A``, ``end = 5 A``, ``slope = 0.2 A/s``,
    ``t_start = t_hold = 0``, ``after = "return"``.
    """
    height = abs(par.end - par.start)
    course: NDArray[np.float64] = np.clip(par.slope * (t - par.t_start), 0.0, height)
    if par.after == "return":
        t_back = par.t_start + height / par.slope + par.t_hold
        course = course - np.clip(par.slope * (t - t_back), 0.0, height)
    return par.start + math.copysign(1.0, par.end - par.start) * course
