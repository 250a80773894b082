"""Push rod of the chamber, with everything that moves with it."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from pydantic import Field

from bywire.authoring import Energy, Mass, ParameterSet, Power, Role, Signal, Unit

Damping = Annotated[float, Unit("N*s/m", 100.0), Field(ge=0, allow_inf_nan=False)]
Loss = Annotated[float, Signal("W", "damping loss of the rod", role=Role("sink", "rod damping"))]


class Parameters(ParameterSet):
    """One mass at the rod; its dry friction belongs to the lever."""

    m: Mass
    """mass of rod, diaphragm, lever and pads, at the rod"""
    d: Damping
    """viscous damping of the rod"""


class State(NamedTuple):
    """Travel and speed, positive toward clamping; zero with the chamber's spring at its stop."""

    x: Annotated[float, Signal("m", "rod travel", 0.02)]
    v: Annotated[float, Signal("m/s", "rod speed", 0.5)]


class Factors(NamedTuple):
    """Factors of the derivatives of travel and speed."""

    x: Annotated[float, Signal("1", "unity")]
    v: Annotated[float, Signal("kg", "mass", 2.0)]


class Balance(NamedTuple):
    """Right-hand sides of travel and speed."""

    x: Annotated[float, Signal("m/s", "rod speed", 0.5)]
    v: Annotated[float, Signal("N", "accelerating force", 500.0)]


class Input(NamedTuple):
    """Forces of chamber and stops, and dry friction."""

    force: Annotated[float, Signal("N", "force of the chamber", 5e3)]
    load: Annotated[float, Signal("N", "load of lever and stop", 5e3)]
    friction: Annotated[float, Signal("N", "friction force, positive along the motion", 50.0)]


def mass(x: State, par: Parameters) -> Factors:
    """Return the factors of the derivatives: 1 and the mass."""
    return Factors(x=1.0, v=par.m)


def balance(x: State, u: Input, par: Parameters) -> Balance:
    r"""Return speed and accelerating force, :math:`m \dot v = F - F_L - d v + F_{fr}`."""
    return Balance(x=x.v, v=u.force - u.load - par.d * x.v + u.friction)


def energy(x: State, par: Parameters) -> Energy:
    """Return the kinetic energy."""
    return 0.5 * par.m * x.v * x.v


def power_in(x: State, u: Input, par: Parameters) -> Power:
    """Return the power of chamber and friction minus the power of the load."""
    return (u.force - u.load + u.friction) * x.v


def power_loss(x: State, par: Parameters) -> Loss:
    """Return the power lost in damping, >= 0."""
    return par.d * x.v * x.v
