"""Motor rotor with all parts that turn with it."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from bywire.authoring import Energy, Inertia, ParameterSet, Power, Role, RotaryDamping, Signal

Loss = Annotated[float, Signal("W", "viscous friction loss", role=Role("sink", "viscous friction"))]


class Parameters(ParameterSet):
    """One inertia, because gear, screw and piston are rigid."""

    J: Inertia
    """inertia of rotor, gear, screw and piston at the motor shaft"""
    D: RotaryDamping
    """viscous friction of the whole drive train at the motor shaft"""


class State(NamedTuple):
    """Angle and speed, zero at the retracted piston, positive toward clamping."""

    theta: Annotated[float, Signal("rad", "motor angle", 50.0)]
    omega: Annotated[float, Signal("rad/s", "motor speed", 100.0)]


class Factors(NamedTuple):
    """Factors of the derivatives of angle and speed."""

    theta: Annotated[float, Signal("1", "unity")]
    omega: Annotated[float, Signal("kg*m**2", "inertia", 3e-4)]


class Balance(NamedTuple):
    """Right-hand sides of angle and speed."""

    theta: Annotated[float, Signal("rad/s", "motor speed", 100.0)]
    omega: Annotated[float, Signal("N*m", "accelerating torque", 1.0)]


class Input(NamedTuple):
    """Motor torque, load and dry friction torque."""

    torque: Annotated[float, Signal("N*m", "motor torque", 1.0)]
    load: Annotated[float, Signal("N*m", "load from the gear", 0.5)]
    friction: Annotated[float, Signal("N*m", "friction torque, positive along the motion", 0.1)]


def mass(x: State, par: Parameters) -> Factors:
    """Return the factors of the derivatives: 1 and the inertia."""
    return Factors(theta=1.0, omega=par.J)


def balance(x: State, u: Input, par: Parameters) -> Balance:
    r"""Return the speed and the accelerating torque.

    .. math:: J \dot\omega = T_m - T_L - D \omega + T_F
    """
    return Balance(theta=x.omega, omega=u.torque - u.load - par.D * x.omega + u.friction)


def energy(x: State, par: Parameters) -> Energy:
    """Return the kinetic energy."""
    return 0.5 * par.J * x.omega * x.omega


def power_in(x: State, u: Input, par: Parameters) -> Power:
    """Return the power of motor and friction minus the power of the load."""
    return (u.torque - u.load + u.friction) * x.omega


def power_loss(x: State, par: Parameters) -> Loss:
    """Return the power lost in viscous friction, >= 0."""
    return par.D * x.omega * x.omega
