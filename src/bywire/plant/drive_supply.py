"""Power at the drives' input: standby of the electronics, and the rig's slow measurement."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Duration, Unit
from bywire.core.signals import Signal

Watts = Annotated[float, Signal("W", "power", 50.0)]


class Parameters(ParameterSet):
    """Stiff supply, lossless power stages: what the motors do not take is standby."""

    P_standby: Annotated[float, Unit("W", 20.0), Field(ge=0, allow_inf_nan=False)]
    """power of the drives' electronics, both together"""
    tau_P: Duration
    """time constant of the power measurement"""


def power(motors: Watts, par: Parameters) -> Watts:
    """Return the power at the input; ``motors`` is the sum of V i of both motors."""
    return par.P_standby + motors


def rate(
    shown: Watts, actual: Watts, par: Parameters
) -> Annotated[float, Signal("W/s", "rate of the shown power", 1e3)]:
    """Return the derivative of the measured power, a first-order lag."""
    return (actual - shown) / par.tau_P
