"""Body that cools and shrinks, such as a hot disc between the pads of a parked brake."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from annotated_types import Ge
from pydantic import Field

from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Duration, Length, Temperature, Unit
from bywire.core.signals import Signal

Expansion = Annotated[float, Unit("1/K", 1.2e-5), Field(ge=0, allow_inf_nan=False)]
Kelvin = Annotated[float, Signal("K", "temperature", 400.0), Ge(0)]


class Parameters(ParameterSet):
    """One temperature, which approaches that of the air. Clamping does not change it."""

    alpha: Expansion
    """coefficient of linear expansion"""
    length: Length
    """length that grows, such as the thickness of the disc"""
    tau: Duration
    """time constant of cooling"""
    T_a: Temperature
    """air temperature, at which the growth is zero"""


class State(NamedTuple):
    """Temperature."""

    T: Annotated[float, Signal("K", "disc temperature", 400.0), Ge(0)]


class Factors(NamedTuple):
    """Factor of the derivative."""

    T: Annotated[float, Signal("s", "time constant", 500.0)]


class Balance(NamedTuple):
    """Distance to the air temperature."""

    T: Annotated[float, Signal("delta_degC", "distance to the air temperature", 100.0)]


class Output(NamedTuple):
    """Growth and its rate."""

    growth: Annotated[float, Signal("m", "thermal growth", 1e-4)]
    rate: Annotated[float, Signal("m/s", "rate of thermal growth", 1e-7)]


def mass(par: Parameters) -> Factors:
    """Return the time constant."""
    return Factors(T=par.tau)


def balance(x: State, par: Parameters) -> Balance:
    r"""Return the distance to the air temperature, :math:`\tau \dot T = T_a - T`."""
    return Balance(T=par.T_a - x.T)


def output(x: State, par: Parameters) -> Output:
    r"""Return the growth and its rate.

    .. math:: g = \alpha \ell (T - T_a), \quad \dot g = \alpha \ell (T_a - T) / \tau

    Between clamped pads, the force changes by the stiffness of the caliper times the growth.
    """
    rise = par.alpha * par.length * (x.T - par.T_a)
    return Output(growth=rise, rate=-rise / par.tau)
