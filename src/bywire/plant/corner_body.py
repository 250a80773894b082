"""A quarter car: the mass above one corner, on a straight road."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from pydantic import Field

from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Unit
from bywire.core.signals import Energy, Power, Signal


class Parameters(ParameterSet):
    """Mass and weight on one wheel, with a constant load."""

    m: Annotated[float, Unit("kg", 450.0), Field(gt=0, allow_inf_nan=False)]
    """mass of the corner"""
    g: Annotated[float, Unit("m/s**2", 9.81), Field(gt=0, allow_inf_nan=False)]
    """gravity"""


class State(NamedTuple):
    """Position and speed."""

    s: Annotated[float, Signal("m", "distance", 30.0)]
    v: Annotated[float, Signal("m/s", "vehicle speed", 20.0)]


class Factors(NamedTuple):
    """Factors of the derivatives."""

    s: Annotated[float, Signal("1", "unity")]
    v: Annotated[float, Signal("kg", "mass", 450.0)]


class Balance(NamedTuple):
    """Right-hand sides of position and speed."""

    s: Annotated[float, Signal("m/s", "vehicle speed", 20.0)]
    v: Annotated[float, Signal("N", "force", 1e3)]


class Input(NamedTuple):
    """Braking force of the tire, and the slope."""

    F: Annotated[float, Signal("N", "braking force of the tire", 1e3)]
    sine: Annotated[float, Signal("1", "sine of the slope", 0.05)]


def load(
    cosine: Annotated[float, Signal("1", "cosine of the slope", 1.0)], par: Parameters
) -> Annotated[float, Signal("N", "wheel load", 4e3)]:
    """Return the wheel load."""
    return par.m * par.g * cosine


def mass(par: Parameters) -> Factors:
    """Return the factors of the derivatives: 1 and the mass."""
    return Factors(s=1.0, v=par.m)


def balance(x: State, u: Input, par: Parameters) -> Balance:
    r"""Return speed and force, :math:`m \dot v = -F - m g \sin\gamma`."""
    return Balance(s=x.v, v=-u.F - par.m * par.g * u.sine)


def energy(x: State, par: Parameters) -> Energy:
    """Return the kinetic energy."""
    return 0.5 * par.m * x.v * x.v


def power_in(x: State, u: Input, par: Parameters) -> Power:
    """Return the power of tire and slope."""
    return -(u.F + par.m * par.g * u.sine) * x.v
