"""Rotor, gear and ball screw: drive train motion with transmission losses."""

from __future__ import annotations

from typing import Annotated, Literal, NamedTuple

from bywire.core import ops
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Fraction, GearRatio, Inertia, Mass
from bywire.core.signals import Energy, Power, ReflectedInertia, Signal, Torque


class Parameters(ParameterSet):
    """Rigid drive train with one efficiency.

    ``law = "paper"`` uses eq. (8), whose constant efficiency makes the gear *generate* energy when
    the load drives it. ``law = "directional"`` makes the loss a load-dependent friction,
    (1/eta_g - 1) times the load torque, in both directions (back-driven efficiency
    2 - 1/eta_g). This friction never generates energy, and it holds the load at rest.
    """

    k_g: GearRatio
    """piston travel per shaft angle"""
    eta_g: Fraction
    """driving efficiency of gear and screw"""
    law: Literal["paper", "directional"]
    """effect of the efficiency: as in eq. (8), or as direction-dependent friction"""
    J_mot: Inertia
    """inertia of rotor, gear and screw at the motor shaft"""
    M_mc: Mass
    """piston mass"""


class State(NamedTuple):
    """Shaft angle and speed, zero at the retracted end, positive toward clamping."""

    theta: Annotated[float, Signal("rad", "motor angle", 20.0)]
    omega: Annotated[float, Signal("rad/s", "motor speed", 20.0)]


class Factors(NamedTuple):
    """Factors of the derivatives of angle and speed."""

    theta: Annotated[float, Signal("1", "unity")]
    omega: Annotated[float, Signal("kg*m**2", "inertia", 3e-5)]


class Balance(NamedTuple):
    """Right-hand sides of angle and speed."""

    theta: Annotated[float, Signal("rad/s", "motor speed", 50.0)]
    omega: Annotated[float, Signal("N*m", "accelerating torque", 0.1)]


class Input(NamedTuple):
    """Motor torque, piston load, and the dry friction torque on the shaft."""

    torque: Annotated[float, Signal("N*m", "motor torque", 0.1)]
    force: Annotated[float, Signal("N", "load on the piston, against clamping", 200.0)]
    friction: Annotated[float, Signal("N*m", "friction torque", 0.01)]


class Bounds(NamedTuple):
    """Limits of the set-valued friction torque on the shaft."""

    low: Annotated[float, Signal("N*m", "friction torque while applying", 0.05)]
    high: Annotated[float, Signal("N*m", "friction torque while releasing", 0.05)]


class Output(NamedTuple):
    """Piston travel and speed."""

    x: Annotated[float, Signal("m", "piston travel", 7e-3)]
    v: Annotated[float, Signal("m/s", "piston speed", 0.02)]


def inertia(par: Parameters) -> ReflectedInertia:
    r"""Return the inertia at the shaft.

    .. math:: M' = \eta_g J_{mot} + k_g^2 M_{mc}

    for law "paper", and without eta_g for law "directional".
    """
    rotor = par.eta_g * par.J_mot if par.law == "paper" else par.J_mot
    return rotor + par.k_g * par.k_g * par.M_mc


def mass(x: State, par: Parameters) -> Factors:
    """Return the factors of the derivatives: 1 and the inertia."""
    return Factors(theta=1.0, omega=inertia(par))


def balance(x: State, u: Input, par: Parameters) -> Balance:
    r"""Return the shaft's speed and the torque that accelerates it.

    .. math:: M' \dot\Omega = \eta_g T - k_g F + T_{fr}

    References
    ----------
    Dardanelli, Alli, Savaresi (2010), eq. (8).
    """
    drive = par.eta_g * u.torque if par.law == "paper" else u.torque
    return Balance(theta=x.omega, omega=drive - par.k_g * u.force + u.friction)


def output(x: State, par: Parameters) -> Output:
    """Return travel and speed of the piston, eq. (7)."""
    return Output(x=par.k_g * x.theta, v=par.k_g * x.omega)


def friction_bounds(
    seal_p: Torque,
    seal_n: Torque,
    load: Annotated[float, Signal("N", "piston load", 200.0)],
    par: Parameters,
) -> Bounds:
    """Return the limits of the dry friction on the shaft, from seals and a directional gear.

    Parameters
    ----------
    seal_p, seal_n
        Magnitudes of the seal friction while applying and releasing.
    load
        Force on the piston, against clamping.
    """
    if par.law == "paper":
        return Bounds(low=-seal_p, high=seal_n)
    share = 1.0 / par.eta_g - 1.0
    torque = par.k_g * load
    return Bounds(
        low=-(seal_p + share * ops.fabs(torque + seal_p)),
        high=seal_n + share * ops.fabs(torque - seal_n),
    )


def energy(x: State, par: Parameters) -> Energy:
    """Return the kinetic energy of rotor and piston."""
    return 0.5 * (par.J_mot + par.k_g * par.k_g * par.M_mc) * x.omega * x.omega


def power_in(x: State, u: Input, par: Parameters) -> Power:
    """Return the motor's power minus the power to the piston."""
    return (u.torque - par.k_g * u.force) * x.omega


def transmission_loss(
    x: State,
    torque: Torque,
    acceleration: Annotated[float, Signal("rad/s**2", "acceleration of the shaft", 1e3)],
    par: Parameters,
) -> Power:
    r"""Return the loss of law "paper", negative when the gear generates energy.

    .. math:: -W_l = (1 - \eta_g) (T - J_{mot} \dot\Omega) \Omega

    References
    ----------
    Dardanelli, Alli, Savaresi (2010), eq. (6).
    """
    if par.law != "paper":
        return 0.0 * torque * x.omega
    return (1.0 - par.eta_g) * (torque - par.J_mot * acceleration) * x.omega


def power_loss(x: State, u: Input, par: Parameters) -> Power:
    """Return transmission and friction losses (signed; law "paper" can generate energy)."""
    acceleration = balance(x, u, par).omega / inertia(par)
    return transmission_loss(x, u.torque, acceleration, par) - u.friction * x.omega
