"""Wheel on the road, with brake and rolling resistance combined into one dry-friction torque."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from annotated_types import Ge
from pydantic import Field

from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Length, Unit
from bywire.core.signals import Energy, Power, Signal

WheelInertia = Annotated[float, Unit("kg*m**2", 0.5), Field(gt=0, allow_inf_nan=False)]


class Parameters(ParameterSet):
    """Rigid wheel with its tire and brake discs."""

    J: WheelInertia
    """inertia"""
    r: Length
    """rolling radius"""
    C_rr: Annotated[float, Unit("1", 0.015), Field(ge=0, lt=1, allow_inf_nan=False)]
    """rolling resistance force relative to the wheel load"""


class State(NamedTuple):
    """Speed of rotation, positive for forward rolling."""

    omega: Annotated[float, Signal("rad/s", "wheel speed", 60.0)]


class Factors(NamedTuple):
    """Factor of the derivative."""

    omega: Annotated[float, Signal("kg*m**2", "inertia", 0.5)]


class Balance(NamedTuple):
    """Right-hand side of the wheel's speed."""

    omega: Annotated[float, Signal("N*m", "torque", 300.0)]


class Input(NamedTuple):
    """Force of the road on the tire, and the torque of brake and rolling resistance."""

    F: Annotated[float, Signal("N", "braking force of the tire", 1e3)]
    friction: Annotated[float, Signal("N*m", "torque of brake and rolling resistance", 300.0)]


def mass(par: Parameters) -> Factors:
    """Return the factor of the derivative, which is the inertia."""
    return Factors(omega=par.J)


def balance(u: Input, par: Parameters) -> Balance:
    r"""Return the torque, :math:`J \dot\omega = r F - T`."""
    return Balance(omega=par.r * u.F + u.friction)


def tread_speed(x: State, par: Parameters) -> Annotated[float, Signal("m/s", "tread speed", 20.0)]:
    r"""Return the speed of the tread, :math:`\omega r`."""
    return x.omega * par.r


def rolling_resistance(
    N: Annotated[float, Signal("N", "load", 1e3), Ge(0)], par: Parameters
) -> Annotated[float, Signal("N*m", "torque of rolling resistance", 5.0)]:
    """Return the torque of the rolling resistance."""
    return par.C_rr * N * par.r


def energy(x: State, par: Parameters) -> Energy:
    """Return the kinetic energy."""
    return 0.5 * par.J * x.omega * x.omega


def power_in(x: State, u: Input, par: Parameters) -> Power:
    """Return the power of road and brake on the wheel."""
    return (par.r * u.F + u.friction) * x.omega
