r"""Choice of the clamp force that the ECU controls: the load cell's reading, or the estimate.

If both differ by more than a limit, the load torque of the motor decides which one is wrong. At
rest and in motion, it lies within the friction of the torque that the clamp force causes,

.. math:: |T_L - \gamma F| \le (1 + \sigma) (C + G F) + T_m

If this excludes the load cell's reading but not the estimate for some time, the estimate takes
over. The load cell takes over again if both have agreed within a smaller limit, under load, for a
longer time. Without load, a lost load cell also reads zero, so agreement there proves nothing.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from annotated_types import Gt
from pydantic import Field, model_validator

from bywire.authoring import Duration, ParameterSet, Signal, Torque, Unit
from bywire.control import clamp_force_estimator as estimator
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
    spread: Annotated[float, Unit("1", 0.5), Field(ge=0, allow_inf_nan=False)]
    """relative uncertainty of the friction"""
    T_margin: Torque
    """uncertainty of the load torque"""

    @model_validator(mode="after")
    def _has_hysteresis(self) -> Parameters:
        if not self.F_close < self.F_apart:
            raise ValueError(
                f"F_close = {self.F_close:g} N must be < F_apart = {self.F_apart:g} N, or the "
                "feedback would change back and forth"
            )
        return self


class State(NamedTuple):
    """Source in use, and the times for which the cell was wrong, and both agreed."""

    on_estimate: Annotated[float, Signal("1", "force control uses the estimate")]
    t_disagree: Elapsed
    t_agree: Elapsed


class Input(NamedTuple):
    """Both forces, and the load torque."""

    F_meas: Annotated[float, Signal("N", "measured clamp force", 1e4)]
    F_hat: Annotated[float, Signal("N", "estimated clamp force", 1e4)]
    T_L: Annotated[float, Signal("N*m", "filtered load torque", 0.5)]
    started: Annotated[float, Signal("1", "the estimator has started")]


class Output(NamedTuple):
    """Force for the controller."""

    F: Annotated[float, Signal("N", "clamp force for control", 1e4)]


def possible(
    F: Annotated[float, Signal("N", "clamp force", 1e4)],
    T_L: Annotated[float, Signal("N*m", "filtered load torque", 0.5)],
    of: estimator.Parameters,
    par: Parameters,
) -> Annotated[float, Signal("1", "the load torque is possible with this clamp force")]:
    """Return 1 if friction explains the difference between load torque and clamp force, or 0."""
    friction = (1.0 + par.spread) * (of.C_hat + of.G_hat * ops.fmax(F, 0.0))
    apart = ops.fabs(T_L - of.gamma * F)
    return ops.where(apart < friction + par.T_margin, 1.0, 0.0)


def output(
    x: State, u: Input, T: SampleTime, of: estimator.Parameters, par: Parameters
) -> tuple[State, Output]:
    """Advance the monitor by one sample."""
    apart = ops.fabs(u.F_meas - u.F_hat)
    cell_is_wrong = possible(u.F_hat, u.T_L, of, par) - possible(u.F_meas, u.T_L, of, par) > 0.5
    wrong = ops.where(cell_is_wrong, u.started, 0.0) > 0.5
    differs = ops.where(apart > par.F_apart, x.t_disagree + T, 0.0)
    disagree = ops.where(wrong, differs, 0.0)
    same = ops.where(apart < par.F_close, x.t_agree + T, 0.0)
    agree = ops.where(u.F_hat > par.F_loaded, same, x.t_agree)
    held = ops.where(agree >= par.t_close, 0.0, x.on_estimate)
    on = ops.where(disagree >= par.t_apart, 1.0, held)
    F = ops.where(on > 0.5, u.F_hat, u.F_meas)
    return State(on, disagree, ops.where(on > 0.5, agree, 0.0)), Output(F)
