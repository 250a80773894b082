"""Choice of the clamp force that the ECU controls: the load cell's reading, or the estimate.

The monitor compares both. If they differ by more than a limit for some time, the estimate takes
over, because the load cell can fail and the angle sensor also commutates the motor. The load cell
takes over again if both have agreed within a smaller limit, under load, for a longer time. Without
load, a lost sensor also reads zero, so agreement there proves nothing.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from annotated_types import Gt
from pydantic import Field, model_validator

from bywire.authoring import Duration, ParameterSet, Signal, Unit
from bywire.core import ops

SampleTime = Annotated[float, Signal("s", "sample time", 1e-3), Gt(0)]
ForceLimit = Annotated[float, Unit("N", 3e3), Field(gt=0, allow_inf_nan=False)]
Elapsed = Annotated[float, Signal("s", "time", 1e-2)]


class Parameters(ParameterSet):
    """Limits and times of both changes."""

    F_apart: ForceLimit
    """difference above which reading and estimate disagree"""
    t_apart: Duration
    """uninterrupted time of disagreement after which the estimate takes over"""
    F_close: ForceLimit
    """difference below which reading and estimate agree"""
    F_loaded: ForceLimit
    """estimated force above which agreement counts"""
    t_close: Duration
    """uninterrupted time of agreement after which the load cell takes over"""

    @model_validator(mode="after")
    def _has_hysteresis(self) -> Parameters:
        if not self.F_close < self.F_apart:
            raise ValueError(
                f"F_close = {self.F_close:g} N must be < F_apart = {self.F_apart:g} N, or the "
                "feedback would change back and forth"
            )
        return self


class State(NamedTuple):
    """Source in use, and the times of disagreement and agreement."""

    on_estimate: Annotated[float, Signal("1", "force control uses the estimate")]
    t_disagree: Elapsed
    t_agree: Elapsed


class Input(NamedTuple):
    """Both forces."""

    F_meas: Annotated[float, Signal("N", "measured clamp force", 1e4)]
    F_hat: Annotated[float, Signal("N", "estimated clamp force", 1e4)]


class Output(NamedTuple):
    """Force for the controller."""

    F: Annotated[float, Signal("N", "clamp force for control", 1e4)]


def output(x: State, u: Input, T: SampleTime, par: Parameters) -> tuple[State, Output]:
    """Advance the monitor by one sample."""
    apart = ops.fabs(u.F_meas - u.F_hat)
    disagree = ops.where(apart > par.F_apart, x.t_disagree + T, 0.0)
    same = ops.where(apart < par.F_close, x.t_agree + T, 0.0)
    agree = ops.where(u.F_hat > par.F_loaded, same, x.t_agree)
    held = ops.where(agree >= par.t_close, 0.0, x.on_estimate)
    on = ops.where(disagree >= par.t_apart, 1.0, held)
    F = ops.where(on > 0.5, u.F_hat, u.F_meas)
    return State(on, disagree, ops.where(on > 0.5, agree, 0.0)), Output(F)
