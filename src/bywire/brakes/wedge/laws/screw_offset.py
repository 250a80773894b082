"""Offset between the two screws, which squeeze the wedge without free play or push it jointly."""

from __future__ import annotations

from typing import Annotated, Literal, NamedTuple

from annotated_types import Gt
from pydantic import model_validator

from bywire.core import ops
from bywire.core.parameters import ParameterSet, RuleError
from bywire.core.quantities import Duration, Force, GearRatio, Position
from bywire.core.signals import Signal
from bywire.core.units import shown

SampleTime = Annotated[float, Signal("s", "sample time", 2e-4), Gt(0)]
ScrewTravel = Annotated[float, Signal("m", "offset of each screw", 4e-5)]


class Parameters(ParameterSet):
    """Positive offsets preload the wedge. With negative offsets, the screws push on each other.

    ``law``: ``"preload"`` always preloads. ``"scheduled"`` preloads near the neutral point, and
    lets the motors work together if the actuation force is large.
    """

    law: Literal["preload", "scheduled"]
    """dependence of the offset on the actuation force"""
    delta_preload: Position
    """offset of each screw from the middle, for preload"""
    delta_together: Position
    """offset of each screw from the middle, for motors working together (law "scheduled")"""
    F_low: Force
    """actuation force up to which the screws preload the wedge (law "scheduled")"""
    F_high: Force
    """actuation force above which the motors work together (law "scheduled")"""
    T_change: Duration
    """time constant of offset changes, slow compared with the position loop"""
    k_hat: GearRatio
    """travel per shaft angle, assumed by the controller"""

    @model_validator(mode="after")
    def _ordered(self) -> Parameters:
        if not self.F_low < self.F_high:
            raise RuleError(
                "F_low", shown(self.F_low, "N"), f"below F_high = {shown(self.F_high, 'N')}"
            )
        return self


class Output(NamedTuple):
    """References of both shafts."""

    theta_1: Annotated[float, Signal("rad", "angle reference 1", 3.0)]
    theta_2: Annotated[float, Signal("rad", "angle reference 2", 3.0)]


def offset(
    F_M: Annotated[float, Signal("N", "actuation force, estimated", 1000.0)], par: Parameters
) -> ScrewTravel:
    """Return the offset of each screw, which changes linearly between the two forces."""
    if par.law == "preload":
        return par.delta_preload
    nodes = (par.F_low, par.F_high)
    return ops.interpolate(ops.fabs(F_M), nodes, (par.delta_preload, par.delta_together))


def advance(delta: ScrewTravel, target: ScrewTravel, T: SampleTime, par: Parameters) -> ScrewTravel:
    """Return the offset one sample later, which follows its target with a first-order lag.

    The controller estimates the actuation force from the currents, and the offset affects the
    currents. Without this lag a schedule would chatter.
    """
    return delta + T / (T + par.T_change) * (target - delta)


def output(
    theta: Annotated[float, Signal("rad", "angle reference", 3.0)],
    delta: ScrewTravel,
    par: Parameters,
) -> Output:
    """Return the references of both shafts around a common reference.

    References
    ----------
    Roberts et al. (2003), section "Brake heart": preload near the ideal point, motors working
    together elsewhere.
    """
    apart = delta / par.k_hat
    return Output(theta_1=theta - apart, theta_2=theta + apart)
