"""Rotor, planetary gear and ball screw: one inertia, and dry friction that rises with the load."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from pydantic import Field

from bywire.authoring import (
    Angle,
    Energy,
    GearRatio,
    Inertia,
    ParameterSet,
    Power,
    Role,
    RotaryDamping,
    Signal,
    Speed,
    Torque,
    Unit,
    signals,
)

Loss = Annotated[float, Signal("W", "viscous loss", role=Role("sink", "viscous friction"))]


class Parameters(ParameterSet):
    """Rigid spindle without backlash or windup. Friction is the same in both directions."""

    J: Inertia
    """inertia of all rotating parts, relative to the rotor"""
    r: GearRatio
    """nut travel per rotor angle"""
    d: RotaryDamping
    """viscous friction"""
    T_0: Torque
    """dry friction without load"""
    c_F: Annotated[float, Unit("m", 1e-6), Field(ge=0, allow_inf_nan=False)]
    """dry friction per unit clamp force"""


class State(NamedTuple):
    """Angle and speed of the rotor, positive toward clamping."""

    theta: Angle
    omega: Speed


class Factors(NamedTuple):
    """Factors of the derivatives."""

    theta: Annotated[float, Signal("1", "one")]
    omega: Annotated[float, Signal("kg*m**2", "inertia", 1e-4)]


class Balance(NamedTuple):
    """Right-hand sides of angle and speed."""

    theta: Speed
    omega: signals.Torque


class Input(NamedTuple):
    """Motor torque, and the clamp force against the nut."""

    torque: Annotated[float, Signal("N*m", "motor torque", 0.3)]
    force: Annotated[float, Signal("N", "clamp force", 1e4)]


class Output(NamedTuple):
    """Travel and velocity of the nut."""

    x: Annotated[float, Signal("m", "travel", 5e-4)]
    v: Annotated[float, Signal("m/s", "velocity", 5e-3)]


def mass(x: State, par: Parameters) -> Factors:
    """Return the factors of the derivatives."""
    return Factors(theta=1.0, omega=par.J)


def balance(x: State, u: Input, par: Parameters) -> Balance:
    r"""Return speed and torque, without dry friction.

    .. math:: J \dot\omega = T - r F - d \omega
    """
    return Balance(theta=x.omega, omega=u.torque - par.r * u.force - par.d * x.omega)


def output(x: State, par: Parameters) -> Output:
    """Return travel and velocity of the nut."""
    return Output(x=par.r * x.theta, v=par.r * x.omega)


def dry_friction(u: Input, par: Parameters) -> Annotated[float, Signal("N*m", "dry friction", 0.1)]:
    """Return the dry friction's magnitude, which at rest is its limit."""
    return par.T_0 + par.c_F * u.force


def energy(x: State, par: Parameters) -> Energy:
    """Return the kinetic energy."""
    return 0.5 * par.J * x.omega * x.omega


def power_in(x: State, u: Input, par: Parameters) -> Power:
    """Return the motor's power minus the power into the caliper."""
    return (u.torque - par.r * u.force) * x.omega


def power_loss(x: State, par: Parameters) -> Loss:
    """Return the power lost in viscous friction, >= 0."""
    return par.d * x.omega * x.omega
