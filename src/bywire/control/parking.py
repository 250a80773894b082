"""Park-brake law: clamp to a force or a current, cut the current, clamp again, and release."""

from __future__ import annotations

from typing import Annotated, Literal, NamedTuple

from annotated_types import Gt
from pydantic import Field, model_validator

from bywire.core import ops
from bywire.core.parameters import ParameterSet, RuleError
from bywire.core.quantities import Current, Duration, TimeConstant, Unit
from bywire.core.signals import Signal

RELEASED, CLAMPS, HOLDS, UNLOCKS, RELEASES = 0.0, 1.0, 2.0, 3.0, 4.0

SampleTime = Annotated[float, Signal("s", "sample time", 1e-2), Gt(0)]
ClampForce = Annotated[float, Unit("N", 1e4), Field(gt=0, allow_inf_nan=False)]
Count = Annotated[float, Unit("1", 2.0), Field(ge=0, allow_inf_nan=False)]
MotorAngle = Annotated[float, Unit("rad", 30.0), Field(allow_inf_nan=False)]
Flag = Annotated[float, Signal("1", "flag", 0.5, low=0.0, high=1.0)]


class Parameters(ParameterSet):
    """Thresholds and times.

    ``law``: with ``"force"``, clamping ends at a measured or estimated force. With ``"current"``,
    it ends at a motor current, after the inrush. ``lock``: what holds the force without current: a
    self-locking screw, or a pawl (see ``plant/pawl_lock.py``). The law unloads the pawl before it
    releases.
    """

    law: Literal["force", "current"]
    """quantity at which clamping ends"""
    lock: Literal["screw", "mono-stable", "bi-stable"]
    """what holds the force without current"""
    F_park: ClampForce
    """force at which clamping ends (law "force")"""
    F_again: ClampForce
    """force below which the brake clamps again (law "force")"""
    i_park: Current
    """current at which clamping ends (law "current")"""
    t_inrush: TimeConstant
    """time after the start of the motor in which the law ignores the current (law "current")"""
    t_again: Duration
    """time after which the brake checks the force, or with law "current" clamps again"""
    again: Count
    """number of times that the brake may clamp again"""
    t_unlock: Duration
    """time after which the law stops trying to unlock the pawl"""
    t_rest: TimeConstant
    """time after a release until the motor is at rest, so that a mono-stable pawl may engage"""
    theta_open: MotorAngle
    """motor angle at which a release ends"""

    @model_validator(mode="after")
    def _clamps_again_below(self) -> Parameters:
        if not self.F_again < self.F_park:
            raise RuleError("F_again", f"{self.F_again:g} N", f"< F_park = {self.F_park:g} N")
        return self


class State(NamedTuple):
    """Memory."""

    mode: Annotated[float, Signal("1", "mode (released, clamps, holds, unlocks, releases)", 2.0)]
    elapsed: Annotated[float, Signal("s", "time in this mode", 1.0)]
    clamped: Annotated[float, Signal("1", "times clamped again", 1.0)]
    powered: Annotated[float, Signal("1", "solenoid with current", 0.5)]


class Input(NamedTuple):
    """Demand, readings, and whether the pawl is engaged."""

    park: Flag
    F: Annotated[float, Signal("N", "clamp force", 1e4)]
    i: Annotated[float, Signal("A", "motor current", 5.0)]
    theta: Annotated[float, Signal("rad", "motor angle", 30.0)]
    engaged: Flag


class Output(NamedTuple):
    """Direction of the motor, and current of the solenoid (0 or 1)."""

    drive: Annotated[float, Signal("1", "drive: 1 clamps, -1 releases", 0.5)]
    powered: Flag


def output(x: State, u: Input, T: SampleTime, par: Parameters) -> tuple[State, Output]:
    r"""Advance the law by one sample.

    While a hot disc cools and shrinks by :math:`\alpha l \Delta T`, the force of a caliper of
    stiffness k falls by :math:`k \alpha l \Delta T`. The law then clamps again after some minutes.

    Notes
    -----
    The pawl is unlocked while the motor clamps, which unloads the tooth. A bi-stable pawl gets
    pulses until it moves. If it does not move in time, the brake stays locked, and the motor stops.
    """
    parks = u.park > 0.5
    if par.law == "force":
        is_reached = u.F - par.F_park >= 0.0 * par.F_park
        is_low = u.F - par.F_again < 0.0 * par.F_again
    else:
        is_reached = ops.where(x.elapsed >= par.t_inrush, u.i, 0.0 * u.i) >= par.i_park
        is_low = par.i_park > 0.0
    due = ops.where(x.elapsed >= par.t_again, ops.where(x.clamped < par.again, 1.0, 0.0), 0.0)
    again = ops.where(is_low, due, 0.0)
    leave = RELEASES if par.lock == "screw" else UNLOCKS
    held = ops.where(again > 0.5, CLAMPS, HOLDS)
    clamped = ops.where(is_reached, HOLDS, CLAMPS)
    applied = ops.where(x.mode == CLAMPS, clamped, ops.where(x.mode == HOLDS, held, CLAMPS))
    unlocked = ops.where(u.engaged > 0.5, UNLOCKS, RELEASES)
    opened = ops.where(u.theta <= par.theta_open, RELEASED, RELEASES)
    is_closed = ops.where(x.mode == CLAMPS, 1.0, ops.where(x.mode == HOLDS, 1.0, 0.0))
    released = ops.where(
        is_closed > 0.5,
        leave,
        ops.where(x.mode == UNLOCKS, unlocked, ops.where(x.mode == RELEASES, opened, RELEASED)),
    )
    mode = ops.where(parks, applied, released)
    kept = ops.where(mode == x.mode, 1.0, 0.0)
    restart = ops.where(is_low, 0.0, due)  # a check that finds enough force
    elapsed = ops.where(kept * (1.0 - restart) > 0.5, x.elapsed + T, 0.0 * T)
    counted = x.clamped + ops.where(parks, again * ops.where(x.mode == HOLDS, 1.0, 0.0), 0.0)
    tries = ops.where(elapsed < par.t_unlock, 1.0, 0.0)
    forward = ops.where(mode == CLAMPS, 1.0, ops.where(mode == UNLOCKS, tries, 0.0))
    powered = _solenoid(mode, elapsed, x.powered, u.engaged, par)
    state = State(mode, elapsed, ops.where(mode == RELEASED, 0.0, counted), powered)
    return state, Output(forward - ops.where(mode == RELEASES, 1.0, 0.0), powered)


def _solenoid(mode: float, elapsed: float, before: float, engaged: float, par: Parameters) -> float:
    """Return the current of the solenoid."""
    if par.lock == "screw":
        return 0.0 * mode
    if par.lock == "mono-stable":
        stops = ops.where(elapsed < par.t_rest, 1.0 - engaged, 0.0)
        tries = ops.where(elapsed < par.t_unlock, 1.0, 0.0)
        moves = ops.where(mode == RELEASES, 1.0, ops.where(mode == UNLOCKS, tries, 0.0))
        return ops.where(mode == RELEASED, stops, moves)
    unlock = ops.where(mode == UNLOCKS, engaged, 0.0)
    lock = ops.where(mode == CLAMPS, 1.0 - engaged, 0.0)
    return ops.where(unlock + lock > 0.5, 1.0 - before, 0.0)
