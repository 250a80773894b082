"""Braking moment sensor at the caliper mount."""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Frequency
from bywire.core.signals import Signal


class Parameters(ParameterSet):
    """Calibrated first-order lag of mount and amplifier."""

    f_M: Frequency
    """corner frequency"""


class State(NamedTuple):
    """Reading."""

    M: Annotated[float, Signal("N*m", "moment measured by the sensor", 300.0)]


class Rate(NamedTuple):
    """Derivative of the state."""

    M: Annotated[float, Signal("N*m/s", "rate of the measured moment", 1e4)]


class Input(NamedTuple):
    """Moment on the mount."""

    M: Annotated[float, Signal("N*m", "braking moment", 300.0)]


def rate(x: State, u: Input, par: Parameters) -> Rate:
    r"""Return the derivative of the measured moment, :math:`2 \pi f_M (M_B - M)`."""
    return Rate(M=2.0 * math.pi * par.f_M * (u.M - x.M))
