"""Wheel speed, computed from the time-stamped edges of a pulse wheel."""

from __future__ import annotations

import math
from typing import Annotated, Literal, NamedTuple

from annotated_types import Ge, Gt
from pydantic import Field

from bywire.core import ops
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Unit
from bywire.core.signals import Signal

SampleTime = Annotated[float, Signal("s", "sample time", 1e-3), Gt(0)]
Age = Annotated[float, Signal("s", "time since the last encoder edge", 1e-3), Ge(0)]


class Parameters(ParameterSet):
    """Wheel sensors assumed by the ECU.

    ``law``: ``"period"`` divides the angle between edges by the time between them, and decreases
    the speed while no edge arrives. ``"difference"`` uses differences of the angle over a sample.
    """

    law: Literal["period", "difference"]
    """method for computing the speed"""
    pulses: Annotated[float, Unit("1", 48.0), Field(ge=1, allow_inf_nan=False)]
    """pulses per revolution"""


class State(NamedTuple):
    """Angle of the last edge, and the speed."""

    angle: Annotated[float, Signal("rad", "angle of the last encoder edge", 100.0)]
    age: Age
    omega: Annotated[float, Signal("rad/s", "measured wheel speed", 60.0)]


class Input(NamedTuple):
    """Registers of the capture unit."""

    angle: Annotated[float, Signal("rad", "angle of the last encoder edge", 100.0)]
    age: Age


def output(x: State, u: Input, T: SampleTime, par: Parameters) -> State:
    """Advance the measurement by one sample; the state contains the speed."""
    turned = u.angle - x.angle
    if par.law == "difference":
        return State(u.angle, u.age, turned / T)
    still = turned == 0
    waited = x.age + T
    slowest = 2.0 * math.pi / par.pulses / waited
    fading = ops.clip(x.omega, -slowest, slowest)
    # After rounding, two edges within a sample may coincide.
    elapsed = ops.fmax(waited - u.age, 1e-3 * T)
    return State(
        u.angle, ops.where(still, waited, u.age), ops.where(still, fading, turned / elapsed)
    )
