"""Refill stroke of a plunger near the end of its travel, behind a closed separation valve."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from pydantic import Field

from bywire.authoring import ParameterSet, Signal, Unit
from bywire.core import ops

MotorAngle = Annotated[float, Unit("rad", 10.0), Field(gt=0, allow_inf_nan=False)]
MotorSpeed = Annotated[float, Unit("rad/s", 40.0), Field(gt=0, allow_inf_nan=False)]
GaugePressure = Annotated[float, Signal("Pa", "pressure", 2e6)]
HOLDS, RETRACTS, BUILDS = 0.0, 1.0, 2.0


class Parameters(ParameterSet):
    """Angles at which the plunger begins and ends to retract, and its speed afterward."""

    theta_begin: MotorAngle
    """motor angle above which a refill begins"""
    theta_end: MotorAngle
    """motor angle at which the plunger is refilled"""
    omega: MotorSpeed
    """motor speed at which the plunger builds up the pressure again after a refill"""


class State(NamedTuple):
    """Phase, and the pressure that the brakes keep."""

    phase: Annotated[float, Signal("1", "phase of the refill", 2.0)]
    p_kept: Annotated[float, Signal("Pa", "pressure that the brakes keep", 5e6)]


class Input(NamedTuple):
    """Pressure demand, motor angle and plunger pressure."""

    p_ref: GaugePressure
    theta: Annotated[float, Signal("rad", "motor angle", 10.0)]
    p: GaugePressure


def output(x: State, u: Input, par: Parameters) -> State:
    """Return the next state.

    Notes
    -----
    The plunger retracts and draws fluid through its cup seal. It then builds up the pressure that
    is trapped in the brakes, and the valve opens again. A demand below the kept pressure ends the
    refill, too.
    """
    begins = ops.where(u.theta > par.theta_begin, RETRACTS, HOLDS)
    refilled = ops.where(u.theta < par.theta_end, BUILDS, RETRACTS)
    opens = ops.where(u.p < ops.fmin(x.p_kept, u.p_ref), BUILDS, HOLDS)
    later = ops.where(x.phase < 1.5, refilled, opens)
    phase = ops.where(x.phase < 0.5, begins, later)
    return State(phase, ops.where(x.phase < 0.5, u.p, x.p_kept))
