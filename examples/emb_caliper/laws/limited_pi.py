"""PI controllers of the cascade, each with a limit at which its integral term stops.

Back-calculation would drive the integral term by the whole excess over the limit. A force step of
25 kN demands three times the maximum speed, and the brake would then creep toward its demand.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from annotated_types import Gt
from pydantic import Field

from bywire.authoring import Current, ParameterSet, Signal, Unit
from bywire.core import ops

SampleTime = Annotated[float, Signal("s", "sample time", 1e-3), Gt(0)]
MotorSpeed = Annotated[float, Unit("rad/s", 300.0), Field(gt=0, allow_inf_nan=False)]
SpeedPerForce = Annotated[float, Unit("rad/(N*s)", 0.03), Field(ge=0, allow_inf_nan=False)]
SpeedPerForceTime = Annotated[float, Unit("rad/(N*s**2)", 0.05), Field(ge=0, allow_inf_nan=False)]
CurrentPerSpeed = Annotated[float, Unit("A*s/rad", 0.5), Field(ge=0, allow_inf_nan=False)]
CurrentPerAngle = Annotated[float, Unit("A/rad", 20.0), Field(ge=0, allow_inf_nan=False)]


class ForceParameters(ParameterSet):
    """Gains from the clamp force error to a motor speed."""

    k_p: SpeedPerForce
    """proportional gain"""
    k_i: SpeedPerForceTime
    """integral gain"""
    omega_max: MotorSpeed
    """maximum speed demand"""


class SpeedParameters(ParameterSet):
    """Gains from the motor speed error to a current."""

    k_p: CurrentPerSpeed
    """proportional gain"""
    k_i: CurrentPerAngle
    """integral gain"""
    i_max: Current
    """maximum current demand"""


class ForceInput(NamedTuple):
    """Force error, and the factor on the gains."""

    error: Annotated[float, Signal("N", "clamp force error", 1e3)]
    factor: Annotated[float, Signal("1", "scale factor for the gains", 1.0)]


class SpeedInput(NamedTuple):
    """Speed error, and the feed-forward current."""

    error: Annotated[float, Signal("rad/s", "speed error", 10.0)]
    ahead: Annotated[float, Signal("A", "feed-forward current", 5.0)]


class ForceState(NamedTuple):
    """Integral term."""

    integral: Annotated[float, Signal("rad/s", "integral term of the force PI", 10.0)]


class SpeedState(NamedTuple):
    """Integral term."""

    integral: Annotated[float, Signal("A", "integral term of the speed PI", 5.0)]


class ForceOutput(NamedTuple):
    """Speed within its limits."""

    omega: Annotated[float, Signal("rad/s", "speed set point", 100.0)]


class SpeedOutput(NamedTuple):
    """Current within its limits."""

    i: Annotated[float, Signal("A", "current set point", 10.0)]


def force(
    x: ForceState, u: ForceInput, T: SampleTime, par: ForceParameters
) -> tuple[ForceState, ForceOutput]:
    r"""Advance the force controller by one sample.

    .. math:: \omega = \kappa k_p e + I, \quad I_{k+1} = I_k + T \kappa k_i e
    """
    wanted = u.factor * par.k_p * u.error + x.integral
    omega = ops.clip(wanted, -par.omega_max, par.omega_max)
    within = ops.fabs(wanted) < par.omega_max
    growth = ops.where(within, u.factor * par.k_i * u.error, 0.0)
    return ForceState(x.integral + T * growth), ForceOutput(omega)


def speed(
    x: SpeedState, u: SpeedInput, T: SampleTime, par: SpeedParameters
) -> tuple[SpeedState, SpeedOutput]:
    r"""Advance the speed controller by one sample.

    .. math:: i = k_p e + I + i_{ff}, \quad I_{k+1} = I_k + T k_i e
    """
    wanted = par.k_p * u.error + x.integral + u.ahead
    i = ops.clip(wanted, -par.i_max, par.i_max)
    growth = ops.where(ops.fabs(wanted) < par.i_max, par.k_i * u.error, 0.0)
    return SpeedState(x.integral + T * growth), SpeedOutput(i)
