"""Caliper that is soft while pads and seals settle, and linear at higher pressure."""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

from annotated_types import Ge
from pydantic import Field

from bywire.core import ops
from bywire.core.faults import ParameterFault
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Pressure, Unit, Volume
from bywire.core.signals import Energy, FluidCompliance, Power, Signal
from bywire.core.typing import Array
from bywire.core.validity import within_limits
from bywire.plant import brake_fluid

Compliance = Annotated[float, Unit("m**3/Pa", 1e-13), Field(gt=0, allow_inf_nan=False)]


class Parameters(ParameterSet):
    """Elastic caliper without hysteresis. Its fluid is as compressible as that of the line."""

    V_1: Volume
    """volume that settles"""
    p_1: Pressure
    """pressure at which 63 % of this volume has settled"""
    c: Compliance
    """compliance of pads and caliper once they have settled"""


FAULTS = (
    ParameterFault("soft", "softer pads or a hose that swells", ("c",), 2.0),
    ParameterFault("knocked-back", "pads pushed back by a warped disc", ("V_1",), 3.0),
)


class State(NamedTuple):
    """Pressure at the pads, gauge."""

    p: Annotated[float, Signal("Pa", "caliper pressure", 2e6), Ge(0)]


class Input(NamedTuple):
    """Flow in."""

    q: Annotated[float, Signal("m**3/s", "flow in", 1e-5)]


def volume(x: State, par: Parameters) -> Annotated[float, Signal("m**3", "volume", 1e-6)]:
    r"""Return the absorbed volume, :math:`V = V_1 (1 - e^{-p/p_1}) + c p`."""
    return par.V_1 * (1.0 - ops.exp(-x.p / par.p_1)) + par.c * x.p


def mass(x: State, par: Parameters) -> FluidCompliance:
    r"""Return :math:`dV/dp = \frac{V_1}{p_1} e^{-p/p_1} + c`, the factor of dp/dt."""
    return par.V_1 / par.p_1 * ops.exp(-x.p / par.p_1) + par.c


def balance(u: Input) -> Annotated[float, Signal("m**3/s", "flow in", 1e-5)]:
    """Return the inflow, which moves the pads."""
    return u.q


def energy(x: State, par: Parameters, fluid: brake_fluid.Parameters) -> Energy:
    r"""Return the energy of the pads and of the inflow, the integral of h(p) dV.

    .. math:: \sum_k \frac{V_1 p_1^k}{\beta^{k-1}}
        \left(1 - e^{-z} \sum_{j \le k} \frac{z^j}{j!}\right) + c \int_0^p h\, dp', \quad z = p/p_1

    with the terms of the flow energy h (`brake_fluid.flow_energy`).
    """
    z = x.p / par.p_1
    decay, partial, scale = ops.exp(-z), 1.0 + 0.0 * z, par.V_1 * par.p_1
    total = par.c * brake_fluid.flow_energy_integral(x.p, fluid)
    power = z
    for k in range(1, 5):
        partial = partial + power / math.factorial(k)
        total = total + scale * (1.0 - decay * partial)
        power, scale = power * z, scale * par.p_1 / fluid.beta
    return total


def power_in(x: State, u: Input, fluid: brake_fluid.Parameters) -> Power:
    """Return the power of the inflow."""
    return brake_fluid.convected_power(u.q, x.p, fluid)


@within_limits
def watch(t: Array, x: State, fluid: brake_fluid.Parameters) -> list[str]:
    """Warn if the absolute pressure is below zero."""
    return brake_fluid.watch(t, x.p, fluid, "in the caliper")
