"""Compressed air as an ideal gas with the reference state of pneumatic components."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from bywire.core import ops
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Density, Pressure, Temperature, Unit
from bywire.core.signals import Signal

Exponent = Annotated[float, Unit("1", 1.4), Field(gt=1, le=1.7, allow_inf_nan=False)]
AbsolutePressure = Annotated[float, Signal("Pa", "absolute pressure", 5e5, low=1.0)]
Kelvin = Annotated[float, Signal("K", "temperature", 300.0, low=1.0)]


class Parameters(ParameterSet):
    """Ideal gas with constant heat capacities.

    The reference state determines the gas constant, so mass and volume flows of components that are
    specified at this state always agree.
    """

    p_ref: Pressure
    """absolute pressure of the reference state (100 kPa in ISO 8778)"""
    rho_0: Density
    """density at the reference state (1.185 kg/m^3 in ISO 8778)"""
    T_0: Temperature
    """temperature of the reference state (293.15 K in ISO 8778), and of the surroundings"""
    gamma: Exponent
    """heat capacity ratio"""
    p_atm: Pressure
    """absolute ambient pressure"""


def gas_constant(
    par: Parameters,
) -> Annotated[float, Signal("J/(kg*K)", "specific gas constant", 287.0)]:
    r"""Return the specific gas constant, :math:`R = p_{ref} / (\rho_0 T_0)`."""
    return par.p_ref / (par.rho_0 * par.T_0)


def exergy(p: AbsolutePressure, par: Parameters) -> Annotated[float, Signal("J/kg", "exergy", 1e5)]:
    r"""Return the exergy per mass of air at ambient temperature.

    .. math:: e = R T_0 \ln(p / p_{atm})

    This is the maximum work that the air can do while it expands isothermally to ambient pressure.
    """
    return gas_constant(par) * par.T_0 * ops.log(p / par.p_atm)


def heat_capacity(
    par: Parameters,
) -> Annotated[float, Signal("J/(kg*K)", "heat capacity at constant volume", 718.0)]:
    r"""Return the heat capacity at constant volume, :math:`c_v = R / (\gamma - 1)`."""
    return gas_constant(par) / (par.gamma - 1.0)
