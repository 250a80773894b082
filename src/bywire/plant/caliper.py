"""Caliper with elastic pads: its pressure increases with the absorbed volume."""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, Literal, NamedTuple

from annotated_types import Ge
from pydantic import Field, model_validator

from bywire.core import ops
from bywire.core.faults import ParameterFault
from bywire.core.parameters import ParameterSet, RuleError
from bywire.core.quantities import Area, Conductance, Nodes, Stiffness, Unit, Volume
from bywire.core.signals import Energy, FluidCompliance, Power, Signal
from bywire.core.typing import Array
from bywire.core.validity import within_limits
from bywire.plant import brake_fluid

Expansion = Annotated[float, Unit("1/K", 7e-4), Field(ge=0, allow_inf_nan=False)]
WarmingRate = Annotated[float, Unit("delta_degC/s", 1.0), Field(allow_inf_nan=False)]


class Parameters(ParameterSet):
    """Single-acting cylinder against the elasticity of the pads.

    ``law``: ``"linear"`` is eq. (11). ``"compressible"`` is eq. (10), with the compressibility
    of the fluid in the caliper. ``"table"`` interpolates a measured pressure-volume curve, whose
    flat start can include the volume of a knock-back. ``leak``: whether the caliper loses fluid to
    the outside, in proportion to the pressure. ``fluid_heat``: whether the fluid in the caliper
    warms and expands. If no port is open, expanding fluid applies the pads. Gas in line and caliper
    (``fluid.air = "caliper"``) increases the volume that the caliper absorbs.
    """

    law: Literal["linear", "compressible", "table"]
    """relation between pressure and volume"""
    A_pd: Area
    """piston area"""
    K_pd: Stiffness
    """stiffness of pads and caliper"""
    p_table: Annotated[Nodes, Unit("Pa", 1e6)]
    """pressures of the table, increasing from 0 (law "table")"""
    V_table: Annotated[Nodes, Unit("m**3", 1e-7)]
    """volumes of the table, increasing from 0 (law "table")"""

    leak: Literal["tight", "leaking"]
    """whether the caliper loses fluid to the outside"""
    G_leak: Conductance
    """leak conductance (leak "leaking")"""
    fluid_heat: Literal["off", "warming"]
    """whether the fluid in the caliper warms"""
    V_hot: Volume
    """volume of the warming fluid (fluid_heat "warming")"""
    alpha_V: Expansion
    """volumetric expansion coefficient of the warming fluid"""
    T_rate: WarmingRate
    """temperature rate of the warming fluid"""

    @model_validator(mode="after")
    def _table_is_a_curve(self) -> Parameters:
        p, V = self.p_table, self.V_table
        if len(p) != len(V):
            valid = f"of the same length as V_table, {len(V)} nodes"
            raise RuleError("p_table", f"{len(p)} nodes", valid)
        if self.law == "table" and len(p) < 2:
            reason = "law = 'table' needs a table"
            raise RuleError("p_table", f"{len(p)} nodes", "of 2 nodes or more", reason)
        for name, nodes in (("p_table", p), ("V_table", V)):
            rising = all(a < b for a, b in pairwise(nodes))
            if nodes and (nodes[0] != 0.0 or not rising):
                raise RuleError(name, str(nodes), "a table that starts at 0 and increases")
        return self


FAULTS = (
    ParameterFault("soft", "softer pads, or a swelling hose", ("K_pd",), 0.5),
    ParameterFault(
        "leaking",
        "fluid leaks to the outside (value: conductance)",
        replaced="G_leak",
        value=1e-13,
        with_it={"leak": "leaking"},
    ),
    ParameterFault(
        "heated",
        "fluid in the caliper warms and expands (value: temperature rate)",
        replaced="T_rate",
        value=1.0,
        with_it={"fluid_heat": "warming"},
    ),
)


class State(NamedTuple):
    """Pressure at the pads, gauge."""

    p: Annotated[float, Signal("Pa", "caliper pressure", 2e6), Ge(0)]


class Input(NamedTuple):
    """Flow in."""

    q: Annotated[float, Signal("m**3/s", "flow in", 1e-6)]


def mass(x: State, par: Parameters, fluid: brake_fluid.Parameters) -> FluidCompliance:
    r"""Return dV/dp, the factor of dp/dt.

    .. math:: (1 + p_{pd}/\beta) \frac{A_{pd}^2}{K_{pd}} \frac{dp_{pd}}{dt} = q_{pd}

    For law "linear", the first factor is absent. For law "table", it is the slope of the table.

    Notes
    -----
    Eq. (10) as printed divides by the volume V_pd = A_pd x_pd, which is 0/0 at zero pressure.
    With p_pd A_pd = K_pd x_pd it takes the form above.

    References
    ----------
    Dardanelli, Alli, Savaresi (2010), eqs. (10) and (11).
    """
    if fluid.air == "caliper":
        return _pads(x, par, fluid) + brake_fluid.gas_compliance(x.p, fluid)
    return _pads(x, par, fluid)


def _pads(x: State, par: Parameters, fluid: brake_fluid.Parameters) -> float:
    """Return dV/dp of the pads and the absorbed fluid."""
    if par.law == "table":
        return _slope(x.p, par)
    spring = par.A_pd * par.A_pd / par.K_pd
    return spring if par.law == "linear" else spring * (1.0 + x.p / fluid.beta)


def expansion(par: Parameters) -> Annotated[float, Signal("m**3/s", "flow", 1e-8)]:
    r"""Return the expansion rate of warming fluid, :math:`\alpha_V V \dot T`."""
    return 0.0 if par.fluid_heat == "off" else par.alpha_V * par.V_hot * par.T_rate


def balance(
    x: State, u: Input, par: Parameters
) -> Annotated[float, Signal("m**3/s", "flow", 1e-6)]:
    """Return the flow that moves the pads, which is inflow plus expansion minus leak."""
    q = u.q if par.fluid_heat == "off" else u.q + expansion(par)
    return q if par.leak == "tight" else q - par.G_leak * x.p


def _slope(p: float, par: Parameters) -> float:
    nodes = list(zip(par.p_table, par.V_table, strict=True))
    slopes = [(V1 - V0) / (p1 - p0) for (p0, V0), (p1, V1) in pairwise(nodes)]
    slope = slopes[0]
    for (p0, _), s in zip(nodes[1:], slopes[1:], strict=False):
        slope = ops.where(p > p0, s, slope)
    return slope


def energy(x: State, par: Parameters, fluid: brake_fluid.Parameters) -> Energy:
    """Return the energy of the pads, the inflow and the gas, which is the integral of h(p) dV."""
    pads = _pad_energy(x, par, fluid)
    return pads + brake_fluid.inflow_energy(x.p, fluid) if fluid.air == "caliper" else pads


def _pad_energy(x: State, par: Parameters, fluid: brake_fluid.Parameters) -> float:
    """Return the energy of the pads and the absorbed fluid."""
    H = brake_fluid.flow_energy_integral
    if par.law == "table":
        total = 0.0 * H(x.p, fluid) * _slope(x.p, par)
        last = len(par.p_table) - 2
        for k in range(last + 1):
            p0, p1 = par.p_table[k], par.p_table[k + 1]
            slope = (par.V_table[k + 1] - par.V_table[k]) / (p1 - p0)
            upper = ops.fmax(x.p, p0) if k == last else ops.clip(x.p, p0, p1)
            total = total + slope * (H(upper, fluid) - H(p0, fluid))
        return total
    spring = par.A_pd * par.A_pd / par.K_pd
    stored = H(x.p, fluid)
    if par.law == "compressible":
        z = x.p / fluid.beta
        stored = stored + x.p * x.p * z / 3.0 * (1.0 + 3.0 * z / 8.0 * (1.0 + 4.0 * z / 15.0))
    return spring * stored


def power_in(x: State, u: Input, par: Parameters, fluid: brake_fluid.Parameters) -> Power:
    """Return the power of the inflow and of expanding fluid."""
    carried = brake_fluid.convected_power(u.q, x.p, fluid)
    return carried if par.fluid_heat == "off" else carried + expansion_power(x, par, fluid)


def expansion_power(x: State, par: Parameters, fluid: brake_fluid.Parameters) -> Power:
    """Return the power of expanding fluid, negative while it cools."""
    return brake_fluid.convected_power(expansion(par), x.p, fluid)


def power_loss(x: State, par: Parameters, fluid: brake_fluid.Parameters) -> Power:
    """Return the power that leaves with the leak, >= 0."""
    if par.leak == "tight":
        return 0.0 * x.p
    return brake_fluid.convected_power(par.G_leak * x.p, x.p, fluid)


@within_limits
def watch(t: Array, x: State, fluid: brake_fluid.Parameters) -> list[str]:
    """Warn if the absolute pressure is below zero."""
    return brake_fluid.watch(t, x.p, fluid, "in the caliper")
