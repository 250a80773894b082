"""Brake circuit with a pressure that follows its demand like a second-order system."""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

from bywire.core.faults import ParameterFault
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Factor, Frequency
from bywire.core.signals import Pressure, Signal


class Parameters(ParameterSet):
    """Substitute for a brake by wire if only its loop dynamics are known."""

    f_n: Frequency
    """natural frequency of the pressure loop"""
    zeta: Factor
    """damping ratio of the pressure loop"""


FAULTS = (ParameterFault("slow", "slower loop: weak drive, cold fluid", ("f_n",), 0.3),)


class State(NamedTuple):
    """Pressure and its rate."""

    p: Pressure
    p_rate: Annotated[float, Signal("Pa/s", "pressure rate", 1e8)]


class Input(NamedTuple):
    """Demand."""

    p_ref: Pressure


class Rates(NamedTuple):
    """Derivatives of pressure and rate."""

    p: Annotated[float, Signal("Pa/s", "pressure rate", 1e8)]
    p_rate: Annotated[float, Signal("Pa/s**2", "acceleration of the pressure", 1e10)]


def rate(x: State, u: Input, par: Parameters) -> Rates:
    r"""Return the derivatives, :math:`\ddot p = \omega^2 (p_{ref} - p) - 2 \zeta \omega \dot p`."""
    w = 2.0 * math.pi * par.f_n
    return Rates(p=x.p_rate, p_rate=w * w * (u.p_ref - x.p) - 2.0 * par.zeta * w * x.p_rate)
