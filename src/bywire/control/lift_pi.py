"""Lift control of a two-wheeler: PI on the deceleration at which the rear wheel would lift."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from annotated_types import Gt
from pydantic import Field

from bywire.core import ops
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Duration, Unit
from bywire.core.signals import Pressure, Signal

SampleTime = Annotated[float, Signal("s", "sample time", 1e-3), Gt(0)]


class Parameters(ParameterSet):
    """Gains of a law that acts before the wheel lifts; a lifted wheel needs a very low demand."""

    a_lim: Annotated[float, Unit("m/s**2", 10.0), Field(gt=0, allow_inf_nan=False)]
    """deceleration limit, which is g l_f/h for a rigid body on a level road"""
    k_p: Annotated[float, Unit("Pa*s**2/m", 1e5), Field(ge=0, allow_inf_nan=False)]
    """proportional gain"""
    T_i: Duration
    """integral time"""
    T_t: Duration
    """tracking time of the anti-windup"""


class State(NamedTuple):
    """Integral term."""

    integral: Pressure


class Input(NamedTuple):
    """Deceleration, rider's demand, the demand to limit, and its previous sample."""

    a: Annotated[float, Signal("m/s**2", "measured deceleration", 10.0)]
    p_rider: Pressure
    p_most: Pressure
    p_before: Pressure


class Output(NamedTuple):
    """Demand, and whether it was lowered."""

    p: Pressure
    lowered: Annotated[float, Signal("1", "lift control is active")]


def output(x: State, u: Input, T: SampleTime, par: Parameters) -> tuple[State, Output]:
    r"""Advance the controller by one sample.

    .. math:: p = \min(p_{most}, K_p (a_{lim} - a) + I)
    """
    error = par.a_lim - u.a
    unlimited = par.k_p * error + x.integral
    p = ops.clip(unlimited, 0.0, ops.fmax(u.p_most, 0.0))
    growth = par.k_p / par.T_i * error + (p - unlimited) / par.T_t
    idle = u.p_before <= 0
    integral = ops.where(idle, ops.fmax(u.p_rider, 0.0), x.integral + T * growth)
    return State(integral), Output(p, ops.where(p < u.p_most, 1.0, 0.0))
