"""Brake fluid with constant bulk modulus, viscosity, and optional entrained air."""

from __future__ import annotations

import math
from typing import Annotated, Literal, NamedTuple

from annotated_types import Ge
from pydantic import Field

from bywire.core import ops
from bywire.core.faults import ParameterFault
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Density, KinematicViscosity, Unit, Volume
from bywire.core.signals import (
    Energy,
    EnthalpyDensity,
    FluidCompliance,
    Power,
    PressureEnergy,
    Signal,
)
from bywire.core.typing import Array
from bywire.core.validity import first, within_limits

GaugePressure = Annotated[float, Signal("Pa", "pressure", 2e6), Ge(0)]


class Parameters(ParameterSet):
    """Newtonian fluid with a constant bulk modulus. Entrained air does not move or dissolve."""

    beta: Annotated[float, Unit("Pa", 1e9), Field(gt=0, allow_inf_nan=False)]
    """bulk modulus"""
    nu: KinematicViscosity
    """kinematic viscosity"""
    rho: Density
    """density"""
    air: Literal["none", "entrained", "caliper"]
    """location of gas bubbles: none, in the master cylinder chamber, or in line and caliper"""
    V_air: Volume
    """gas volume at ambient pressure"""
    n_air: Annotated[float, Unit("1", 1.2), Field(gt=1, le=1.7, allow_inf_nan=False)]
    """polytropic exponent of the gas (near 1: isothermal; 1.4: adiabatic)"""
    p_atm: Annotated[float, Unit("Pa", 1e5), Field(gt=0, allow_inf_nan=False)]
    """ambient pressure, absolute"""


FAULTS = (
    ParameterFault(
        "air",
        "gas bubbles in the chamber (value: volume)",
        replaced="V_air",
        value=8.8e-9,
        with_it={"air": "entrained"},
    ),
    ParameterFault(
        "air-in-line",
        "gas bubbles in line and caliper (value: volume)",
        replaced="V_air",
        value=1.28e-6,
        with_it={"air": "caliper"},
    ),
    ParameterFault("cold", "thicker fluid", ("nu",), 3.0),
)


@within_limits
def watch(t: Array, p: GaugePressure, par: Parameters, place: str) -> list[str]:
    """Warn if the absolute pressure at a place, such as "in the caliper", is below zero."""
    text = f"the absolute pressure {place} is below zero"
    return first(t, p < -par.p_atm, text, ". Real fluid would evaporate, which is not modeled")


class Chamber(NamedTuple):
    """Chamber volume, including fluid and gas, and gauge pressure."""

    V: Annotated[float, Signal("m**3", "chamber volume", 3e-7), Ge(0)]
    p: GaugePressure


def gas_volume(p: GaugePressure, par: Parameters) -> Annotated[float, Signal("m**3", "gas", 1e-7)]:
    r"""Return the volume of the gas.

    .. math:: V_g = V_{air} \left(\frac{p_{atm}}{p_{atm} + p}\right)^{1/n}
    """
    if par.air != "entrained":
        return 0.0 * par.V_air
    absolute = par.p_atm + ops.fmax(p, 0.0)
    return par.V_air * ops.power(par.p_atm / absolute, 1.0 / par.n_air)


def compliance(u: Chamber, par: Parameters) -> FluidCompliance:
    r"""Return dV/dp of a chamber's fluid, including its gas.

    .. math:: \frac{V - V_g}{\beta} + \frac{V_g}{n (p_{atm} + p)}

    The fluid fills only the volume without gas. With V instead of V - V_g, the stored energy would
    not be the integral of the powers.
    """
    if par.air != "entrained":
        return u.V / par.beta
    gas = gas_volume(u.p, par)
    return (u.V - gas) / par.beta + gas_compliance(u.p, par)


def gas_compliance(p: GaugePressure, par: Parameters) -> FluidCompliance:
    r"""Return :math:`-dV_g/dp` of the gas in any location. The parameters must declare gas.

    .. math:: \frac{V_{air}}{n (p_{atm} + p)} \left(\frac{p_{atm}}{p_{atm} + p}\right)^{1/n}
    """
    absolute = par.p_atm + ops.fmax(p, 0.0)
    gas = par.V_air * ops.power(par.p_atm / absolute, 1.0 / par.n_air)
    return gas / (par.n_air * absolute)


def compression_energy(u: Chamber, par: Parameters) -> Energy:
    """Return a chamber's energy from the compression of its fluid and gas."""
    density = flow_energy_integral(u.p, par) / par.beta
    if par.air != "entrained":
        return u.V * density
    return (u.V - gas_volume(u.p, par)) * density + gas_energy(u.p, par)


def gas_energy(p: GaugePressure, par: Parameters) -> Energy:
    """Return the energy in the compressed gas, the integral of p dV from ambient pressure."""
    if par.air == "none":
        return 0.0 * p * par.V_air
    n = par.n_air
    ratio = (par.p_atm + ops.fmax(p, 0.0)) / par.p_atm
    head = (ops.power(ratio, 1.0 - 1.0 / n) - 1.0) * n / (n - 1.0)
    tail = n * (ops.power(ratio, -1.0 / n) - 1.0)
    return par.V_air * par.p_atm / n * (head + tail)


def inflow_energy(p: GaugePressure, par: Parameters) -> Energy:
    r"""Return the energy that inflow supplies to gas and fluid together.

    .. math:: \int_0^p h(p') \left(-\frac{dV_g}{dp'}\right) dp'

    with the flow energy h of `flow_energy`, term by term in closed form.
    """
    m, a = 1.0 / par.n_air, par.p_atm
    ratio = (a + ops.fmax(p, 0.0)) / a
    decay = ops.power(ratio, -m)
    total = 0.0 * p
    scale = par.V_air * m * a
    for k in range(1, 5):  # the terms of h: p^k / (k! beta^(k - 1))
        moment, grown = 0.0 * p, decay
        for j in range(k + 1):
            moment = moment + (-1.0) ** (k - j) * math.comb(k, j) * (grown - 1.0) / (j - m)
            grown = grown * ratio
        total = total + scale * moment / math.factorial(k)
        scale = scale * a / par.beta
    return total


def flow_energy(
    p: Annotated[float, Signal("Pa", "pressure", 2e6)], par: Parameters
) -> EnthalpyDensity:
    r"""Return the energy per volume of a flow at a pressure.

    .. math:: h(p) = \beta (e^{p/\beta} - 1) \approx
        p (1 + \tfrac{z}{2} (1 + \tfrac{z}{3} (1 + \tfrac{z}{4}))), \quad z = p/\beta

    This is flow work plus transported compression energy. The relative error of the series is
    z^4/120, below 1e-11 up to 50 bar.
    """
    c1 = 1.0 / (2.0 * par.beta)
    c2 = c1 / (3.0 * par.beta)
    c3 = c2 / (4.0 * par.beta)
    return p * (1.0 + p * (c1 + p * (c2 + p * c3)))


def flow_energy_integral(
    p: Annotated[float, Signal("Pa", "pressure", 2e6)], par: Parameters
) -> PressureEnergy:
    """Return the integral of ``flow_energy`` over pressure from 0 to p.

    Divided by beta, it is the stored compression energy per volume.
    """
    z = p / par.beta
    return 0.5 * p * p * (1.0 + z / 3.0 * (1.0 + z / 4.0 * (1.0 + z / 5.0)))


def convected_power(
    q: Annotated[float, Signal("m**3/s", "flow", 1e-6)],
    p: Annotated[float, Signal("Pa", "pressure", 2e6)],
    par: Parameters,
) -> Power:
    """Return the power transported by a flow q at pressure p."""
    return q * flow_energy(p, par)
