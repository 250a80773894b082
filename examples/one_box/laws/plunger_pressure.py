"""Pressure control of a plunger, which returns a reference for its position control."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from annotated_types import Gt
from pydantic import Field

from bywire.authoring import Area, GearRatio, ParameterSet, Pressure, Signal, Unit
from bywire.core import ops
from bywire.plant import stiffening_caliper

Rate = Annotated[float, Unit("1/s", 50.0), Field(gt=0, allow_inf_nan=False)]
MotorSpeed = Annotated[float, Unit("rad/s", 100.0), Field(gt=0, allow_inf_nan=False)]
MotorAngle = Annotated[float, Unit("rad", 1.0), Field(gt=0, allow_inf_nan=False)]
SampleTime = Annotated[float, Signal("s", "sample time", 1e-3), Gt(0)]
GaugePressure = Annotated[float, Signal("Pa", "pressure", 2e6)]
Angle = Annotated[float, Signal("rad", "motor angle", 10.0)]
Speed = Annotated[float, Signal("rad/s", "speed of the reference", 50.0)]


class Parameters(ParameterSet):
    """Proportional law for the plunger's speed, which fills the brakes' assumed volume.

    The pressure is the integral of the speed, so the loop's crossover frequency is the same at all
    pressures.
    """

    omega_c: Rate
    """crossover frequency of the loop"""
    omega_max: MotorSpeed
    """limit of the motor speed"""
    lead: MotorAngle
    """maximum distance between the reference and the measured angle"""
    p_on: Pressure
    """demand below which the plunger returns to its rest position"""
    theta_rest: MotorAngle
    """motor angle at the rest position"""
    theta_end: MotorAngle
    """maximum motor angle"""
    A_hat: Area
    """area of the plunger assumed by the ECU"""
    k_hat: GearRatio
    """plunger travel per motor angle assumed by the ECU"""
    brakes: stiffening_caliper.Parameters
    """volume of all brakes assumed by the ECU"""


class State(NamedTuple):
    """Reference of the motor angle."""

    theta_ref: Angle


class Input(NamedTuple):
    """Pressure demand and measured pressure."""

    p_ref: GaugePressure
    p: GaugePressure


def output(x: State, u: Input, par: Parameters) -> Speed:
    r"""Return the speed of the reference.

    .. math:: \omega = \omega_c \frac{\hat C(p)}{\hat k \hat A} (p_{ref} - p), \quad
        \hat C(p) = \frac{dV}{dp}

    Below ``p_on``, the reference returns to the rest angle with the same crossover frequency.
    """
    C = stiffening_caliper.mass(stiffening_caliper.State(ops.fmax(u.p, 0.0)), par.brakes)
    pressing = par.omega_c * C / (par.k_hat * par.A_hat) * (u.p_ref - u.p)
    parking = par.omega_c * (par.theta_rest - x.theta_ref)
    wanted = ops.where(u.p_ref < par.p_on, parking, pressing)
    return ops.clip(wanted, -par.omega_max, par.omega_max)


def advanced(x: State, omega: Speed, theta: Angle, T: SampleTime, par: Parameters) -> State:
    """Return the reference after a sample, near the measured angle and within the travel."""
    near = ops.clip(x.theta_ref + T * omega, theta - par.lead, theta + par.lead)
    return State(ops.clip(near, par.theta_rest, par.theta_end))
