"""Pulse wheel on a road wheel, with a capture unit that time-stamps its edges."""

from __future__ import annotations

import math
from typing import Annotated, Literal, NamedTuple

from pydantic import Field

from bywire.core import ops
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Unit
from bywire.core.signals import Signal

WheelSpeed = Annotated[float, Signal("rad/s", "wheel speed", 60.0)]


class Parameters(ParameterSet):
    """One edge for each pulse, without lost pulses. Time stamps are exact.

    ``law``: with ``"pulses"``, the sensor measures edges; with ``"ideal"``, the angle at any time.
    """

    law: Literal["ideal", "pulses"]
    """whether the sensor measures only edges, or the angle at any time"""
    pulses: Annotated[float, Unit("1", 48.0), Field(ge=1, allow_inf_nan=False)]
    """pulses per revolution"""
    omega_min: Annotated[float, Unit("rad/s", 0.1), Field(gt=0, allow_inf_nan=False)]
    """minimum speed at which the time stamps of edges are valid"""


class State(NamedTuple):
    """Wheel angle."""

    theta: Annotated[float, Signal("rad", "wheel angle", 100.0)]


class Input(NamedTuple):
    """Wheel speed."""

    omega: WheelSpeed


class Reading(NamedTuple):
    """Registers of the capture unit."""

    angle: Annotated[float, Signal("rad", "angle of the last encoder edge", 100.0)]
    age: Annotated[float, Signal("s", "time since the last encoder edge", 1e-3)]


def rate(u: Input) -> WheelSpeed:
    """Return the rate of the angle."""
    return u.omega


def reading(x: State, u: Input, par: Parameters) -> Reading:
    """Return the angle of the last edge and the time since (zero for an ideal angle)."""
    if par.law == "ideal":
        return Reading(x.theta, 0.0)
    step = 2.0 * math.pi / par.pulses
    angle = step * ops.floor(x.theta / step)
    return Reading(angle, (x.theta - angle) / ops.fmax(ops.fabs(u.omega), par.omega_min))
