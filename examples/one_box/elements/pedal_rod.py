"""Rod between pedal and pedal simulator, with everything that moves with it."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from pydantic import Field

from bywire.authoring import Energy, Force, Mass, ParameterSet, Power, Signal, Unit

LeverRatio = Annotated[float, Unit("1", 4.0), Field(ge=1, le=10, allow_inf_nan=False)]


class Parameters(ParameterSet):
    """One mass at the rod, and the lever between foot and rod."""

    m: Mass
    """mass of rod, piston and pedal, at the rod"""
    i: LeverRatio
    """travel of the foot per travel of the rod"""
    F_0: Force
    """preload of the return spring, at the rod"""


class State(NamedTuple):
    """Travel and speed, positive toward clamping; zero at the released pedal."""

    x: Annotated[float, Signal("m", "rod travel", 0.01)]
    v: Annotated[float, Signal("m/s", "rod speed", 0.1)]


class Factors(NamedTuple):
    """Factors of the derivatives of travel and speed."""

    x: Annotated[float, Signal("1", "unity")]
    v: Annotated[float, Signal("kg", "mass", 1.0)]


class Balance(NamedTuple):
    """Right-hand sides of travel and speed."""

    x: Annotated[float, Signal("m/s", "rod speed", 0.1)]
    v: Annotated[float, Signal("N", "accelerating force", 100.0)]


class Input(NamedTuple):
    """Forces of foot, simulator and stops."""

    foot: Annotated[float, Signal("N", "foot force", 100.0)]
    load: Annotated[float, Signal("N", "load of the simulator and the stops", 300.0)]


def mass(par: Parameters) -> Factors:
    """Return the factors of the derivatives: 1 and the mass."""
    return Factors(x=1.0, v=par.m)


def balance(x: State, u: Input, par: Parameters) -> Balance:
    r"""Return speed and accelerating force, :math:`m \dot v = i F - F_0 - F_L`."""
    return Balance(x=x.v, v=par.i * u.foot - par.F_0 - u.load)


def foot_power(x: State, u: Input, par: Parameters) -> Power:
    """Return the power of the foot."""
    return par.i * u.foot * x.v


def energy(x: State, par: Parameters) -> Energy:
    """Return the energy of mass and return spring."""
    return 0.5 * par.m * x.v * x.v + par.F_0 * x.x


def power_in(x: State, u: Input, par: Parameters) -> Power:
    """Return the power of the foot minus the power of the load."""
    return (par.i * u.foot - u.load) * x.v
