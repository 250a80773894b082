"""Rotor of a servo motor with a prescribed current, without winding or drive."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from bywire.core.signals import Energy, Power, Signal
from bywire.plant import servo_motor

Parameters = servo_motor.Parameters


class State(NamedTuple):
    """Shaft angle and speed, positive toward clamping."""

    theta: Annotated[float, Signal("rad", "motor angle", 3.0)]
    omega: Annotated[float, Signal("rad/s", "motor speed", 50.0)]


class Factors(NamedTuple):
    """Factors of the derivatives."""

    theta: Annotated[float, Signal("1", "unity")]
    omega: Annotated[float, Signal("kg*m**2", "inertia", 1e-4)]


class Balance(NamedTuple):
    """Right-hand sides of angle and speed."""

    theta: Annotated[float, Signal("rad/s", "motor speed", 50.0)]
    omega: Annotated[float, Signal("N*m", "accelerating torque", 0.5)]


class Input(NamedTuple):
    """Current, load torque, and dry friction torque on the shaft."""

    i: Annotated[float, Signal("A", "motor current", 5.0)]
    load: Annotated[float, Signal("N*m", "torque of the screw on the shaft", 0.5)]
    friction: Annotated[float, Signal("N*m", "friction torque", 0.1)]


def mass(par: Parameters) -> Factors:
    """Return the factors of the derivatives: 1 and the inertia."""
    return Factors(theta=1.0, omega=par.J_M)


def balance(x: State, u: Input, par: Parameters) -> Balance:
    """Return speed and torque, as in `servo_motor.balance`."""
    motor = servo_motor.State(u.i, x.theta, x.omega)
    rows = servo_motor.balance(motor, servo_motor.Input(0.0, u.load, u.friction), par)
    return Balance(theta=rows.theta, omega=rows.omega)


def energy(x: State, par: Parameters) -> Energy:
    """Return kinetic and cogging energy."""
    return servo_motor.energy(servo_motor.State(0.0, x.theta, x.omega), par)


def power_in(x: State, u: Input, par: Parameters) -> Power:
    """Return the power through the air gap and at the shaft."""
    return (servo_motor.torque_constant(par) * u.i + u.load + u.friction) * x.omega


def power_loss(x: State, par: Parameters) -> Power:
    """Return the heat from viscous damping, >= 0."""
    return servo_motor.damping_loss(servo_motor.State(0.0, x.theta, x.omega), par)
