"""Air volume with mass and temperature, isothermal or with heat exchange to its walls."""

from __future__ import annotations

from typing import Annotated, Literal, NamedTuple

from bywire.core import ops
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import HeatConductance
from bywire.core.signals import Energy, Power, Signal
from bywire.plant import air


class Parameters(ParameterSet):
    """Well-mixed ideal gas.

    ``law``: ``"isothermal"`` keeps the air at ambient temperature. Its energy is then exergy, the
    work that it can do. ``"heat"`` computes the temperature, and the energy is the internal energy.
    ``G_w = 0`` is then adiabatic.
    """

    law: Literal["isothermal", "heat"]
    """whether the air temperature is constant"""
    G_w: HeatConductance
    """heat conductance between air and walls (law "heat")"""


class State(NamedTuple):
    """Mass and temperature."""

    m: Annotated[float, Signal("kg", "mass of air", 5e-3, low=1e-6)]
    T: air.Kelvin


class Factors(NamedTuple):
    """Factors of the states' derivatives."""

    m: Annotated[float, Signal("1", "one", 1.0)]
    T: Annotated[float, Signal("J/K", "heat capacity", 3.0)]


class Balance(NamedTuple):
    """Right-hand sides of the states."""

    m: Annotated[float, Signal("kg/s", "mass flow", 1e-2)]
    T: Annotated[float, Signal("W", "heating", 100.0)]


class Input(NamedTuple):
    """Sum of the flows into the volume, the volume, and its derivative."""

    mdot: Annotated[float, Signal("kg/s", "mass flow in", 1e-2)]
    H: Annotated[float, Signal("W", "enthalpy flow in", 1e3)]
    V: Annotated[float, Signal("m**3", "volume", 1e-3, low=1e-7)]
    V_rate: Annotated[float, Signal("m**3/s", "rate of the volume", 1e-3)]


class InputRate(NamedTuple):
    """Derivative of the input that affects the stored energy."""

    V: Annotated[float, Signal("m**3/s", "rate of the volume", 1e-3)]


def temperature(x: State, par: Parameters, gas: air.Parameters) -> air.Kelvin:
    """Return the air temperature, which is a state, or ambient (law "isothermal")."""
    return x.T if par.law == "heat" else gas.T_0


def pressure(x: State, u: Input, par: Parameters, gas: air.Parameters) -> air.AbsolutePressure:
    r"""Return the absolute pressure, :math:`p = m R T / V`."""
    return x.m * air.gas_constant(gas) * temperature(x, par, gas) / u.V


def mass(x: State, par: Parameters, gas: air.Parameters) -> Factors:
    """Return the factors of the derivatives of mass and temperature."""
    return Factors(m=1.0, T=x.m * air.heat_capacity(gas))


def balance(x: State, u: Input, par: Parameters, gas: air.Parameters) -> Balance:
    r"""Return the right-hand sides.

    .. math::
        \frac{dm}{dt} = \sum \dot m, \quad
        m c_v \frac{dT}{dt} = \sum \dot H - c_v T \frac{dm}{dt} - p \frac{dV}{dt} + G_w (T_0 - T)

    for law "heat". With law "isothermal", the temperature is constant.
    """
    if par.law == "isothermal":
        return Balance(m=u.mdot, T=0.0 * u.H)
    work = pressure(x, u, par, gas) * u.V_rate
    heat = par.G_w * (gas.T_0 - x.T)
    return Balance(m=u.mdot, T=u.H - air.heat_capacity(gas) * x.T * u.mdot - work + heat)


def energy(x: State, u: Input, par: Parameters, gas: air.Parameters) -> Energy:
    r"""Return the exergy :math:`V (p \ln(p/p_{atm}) - (p - p_{atm}))`, or :math:`m c_v T`.

    Law "isothermal" has the exergy, and law "heat" the internal energy :math:`m c_v T`.
    """
    if par.law == "heat":
        return x.m * air.heat_capacity(gas) * x.T
    p = pressure(x, u, par, gas)
    return u.V * (p * ops.log(p / gas.p_atm) - (p - gas.p_atm))


def input_rate(u: Input) -> InputRate:
    """Return the rate of the volume, through which the air does work."""
    return InputRate(V=u.V_rate)


def power_in(x: State, u: Input, par: Parameters, gas: air.Parameters) -> Power:
    """Return the inflow power minus the work of the growing volume, plus wall heat."""
    p = pressure(x, u, par, gas)
    if par.law == "heat":
        return u.H - p * u.V_rate + par.G_w * (gas.T_0 - x.T)
    return u.mdot * air.exergy(p, gas) - (p - gas.p_atm) * u.V_rate
