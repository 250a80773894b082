"""Rigid motor-driven shaft with viscous damping."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Inertia, RotaryDamping
from bywire.core.signals import Energy, Power, Role, Signal

Loss = Annotated[float, Signal("W", "viscous loss", role=Role("sink", "viscous damping"))]


class Parameters(ParameterSet):
    """Inertia and damping of all bodies that turn with the shaft, without elasticity."""

    J: Inertia
    """inertia"""
    d: RotaryDamping
    """viscous damping"""


class State(NamedTuple):
    """Angle and speed."""

    theta: Annotated[float, Signal("rad", "shaft angle", 20.0)]
    omega: Annotated[float, Signal("rad/s", "shaft speed", 20.0)]


class Factors(NamedTuple):
    """Factors of the derivatives."""

    theta: Annotated[float, Signal("1", "unity")]
    omega: Annotated[float, Signal("kg*m**2", "inertia", 3e-5)]


class Balance(NamedTuple):
    """Right-hand sides of angle and speed."""

    theta: Annotated[float, Signal("rad/s", "shaft speed", 20.0)]
    omega: Annotated[float, Signal("N*m", "accelerating torque", 0.1)]


class Input(NamedTuple):
    """Torques on the shaft: driving torque minus load, and dry friction."""

    torque: Annotated[float, Signal("N*m", "torque", 0.1)]
    friction: Annotated[float, Signal("N*m", "friction torque", 0.01)]


def mass(par: Parameters) -> Factors:
    """Return the factors of the derivatives: 1 and the inertia."""
    return Factors(theta=1.0, omega=par.J)


def balance(x: State, u: Input, par: Parameters) -> Balance:
    r"""Return speed and torque, :math:`J \dot\omega = T - d \omega + T_{fr}`."""
    return Balance(theta=x.omega, omega=u.torque - par.d * x.omega + u.friction)


def energy(x: State, par: Parameters) -> Energy:
    """Return the kinetic energy."""
    return 0.5 * par.J * x.omega * x.omega


def power_in(x: State, u: Input, par: Parameters) -> Power:
    """Return the power of all torques except damping."""
    return (u.torque + u.friction) * x.omega


def power_loss(x: State, par: Parameters) -> Loss:
    """Return the heat from viscous damping, >= 0."""
    return par.d * x.omega * x.omega
