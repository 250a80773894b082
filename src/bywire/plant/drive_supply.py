"""Power at the drives' input, with standby power and the rig's slow measurement."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from pydantic import Field

from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Duration, Unit
from bywire.core.signals import Signal

Watts = Annotated[float, Signal("W", "power", 50.0)]


class Parameters(ParameterSet):
    """Stiff supply and lossless power stages. All power except the motor power is standby."""

    P_standby: Annotated[float, Unit("W", 20.0), Field(ge=0, allow_inf_nan=False)]
    """total power of the electronics of both drives"""
    tau_P: Duration
    """time constant of the power measurement"""


class State(NamedTuple):
    """Reading of the measurement."""

    P: Annotated[float, Signal("W", "input power, filtered", 50.0)]


class Rate(NamedTuple):
    """Derivative of the state."""

    P: Annotated[float, Signal("W/s", "rate of the measured power", 1e3)]


class Input(NamedTuple):
    """Power of all motors."""

    motors: Watts


def power(motors: Watts, par: Parameters) -> Watts:
    """Return the power at the input. ``motors`` is the sum of V i over both motors."""
    return par.P_standby + motors


def rate(x: State, u: Input, par: Parameters) -> Rate:
    """Return the derivative of the measured power, a first-order lag."""
    return Rate(P=(power(u.motors, par) - x.P) / par.tau_P)
