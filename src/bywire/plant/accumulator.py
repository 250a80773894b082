r"""Low-pressure accumulator of an anti-lock system, where a sprung piston stores released fluid.

Between its stops, the piston moves against its spring. At the stops, only the fluid and its gas
bubbles yield. If a pump sucks on an empty accumulator, the bubbles expand and the pressure falls
toward vacuum, so that the flow ends. A one-sided limit on the volume would create the fluid that
the pump takes (see ``docs/decisions/0038-starved-pump.md``).
"""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

from pydantic import Field

from bywire.core import ops
from bywire.core.faults import ParameterFault
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Pressure, Unit
from bywire.core.signals import Energy, Power, Signal
from bywire.core.typing import Array
from bywire.core.validity import first, within_limits
from bywire.plant import brake_fluid

Stiffness = Annotated[float, Unit("Pa/m**3", 1e11), Field(gt=0, allow_inf_nan=False)]
Capacity = Annotated[float, Unit("m**3", 3.5e-6), Field(gt=0, allow_inf_nan=False)]
Compliance = Annotated[float, Unit("m**3/Pa", 4e-15), Field(gt=0, allow_inf_nan=False)]
GaugePressure = Annotated[float, Signal("Pa", "accumulator pressure", 2e5)]


class Parameters(ParameterSet):
    """Massless piston between two stops, without friction."""

    p_0: Pressure
    """pressure at which the spring starts to yield"""
    k: Stiffness
    """pressure per volume"""
    V_max: Capacity
    """volume at the far stop"""
    c_stop: Compliance
    """compliance of fluid and gas while the piston is at a stop"""


FAULTS = (
    ParameterFault("stiff", "the piston jams (value: factor)", ("k",), 10.0),
    ParameterFault("small", "debris shortens the stroke (value: factor)", ("V_max",), 0.2),
)


class State(NamedTuple):
    """Stored volume."""

    V: Annotated[float, Signal("m**3", "stored volume", 1e-6)]


class Input(NamedTuple):
    """Flow in."""

    q: Annotated[float, Signal("m**3/s", "flow in", 1e-5)]


def mass(x: State) -> Annotated[float, Signal("1", "one", 1.0)]:
    """Return the factor of the volume's derivative, 1."""
    return 1.0


def balance(u: Input) -> Annotated[float, Signal("m**3/s", "flow in", 1e-5)]:
    """Return the rate of the volume."""
    return u.q


def _expanded(x: State, par: Parameters, fluid: brake_fluid.Parameters) -> tuple[float, float]:
    """Return the expansion of the gas relative to its volume at the near stop, and P_0."""
    P_0 = fluid.p_atm + par.p_0
    return 1.0 + ops.fmax(-1.0 * x.V, 0.0) / (par.c_stop * P_0), P_0


def pressure(x: State, par: Parameters, fluid: brake_fluid.Parameters) -> GaugePressure:
    r"""Return the gauge pressure.

    .. math::
        p = \begin{cases}
        P_0 \left(1 - \dfrac{V}{c_{stop} P_0}\right)^{-1} - p_{atm} & V < 0 \\
        p_0 + k V & 0 \le V \le V_{max} \\
        p_0 + k V + (V - V_{max})/c_{stop} & V > V_{max}
        \end{cases}, \quad P_0 = p_{atm} + p_0

    Notes
    -----
    The pressure has kinks where the piston reaches a stop, at V = 0 and V_max. The absolute
    pressure is always positive. Below the near stop, a negative volume is fluid that is missing.
    """
    expansion, P_0 = _expanded(x, par, fluid)
    drop = P_0 - P_0 / expansion
    beyond = ops.fmax(x.V - par.V_max, 0.0) / par.c_stop
    return par.p_0 + par.k * ops.fmax(x.V, 0.0) + beyond - drop


def energy(x: State, par: Parameters, fluid: brake_fluid.Parameters) -> Energy:
    """Return the energy of spring and fluid, the integral of h(p) dV from the near stop.

    h is the flow energy (`brake_fluid.flow_energy`), term by term in closed form.
    """
    H = brake_fluid.flow_energy_integral
    p_full = par.p_0 + par.k * par.V_max
    sprung = par.p_0 + par.k * ops.clip(x.V, 0.0, par.V_max)
    stiff = par.k + 1.0 / par.c_stop
    above = p_full + stiff * ops.fmax(x.V - par.V_max, 0.0)
    spring = (H(sprung, fluid) - H(par.p_0, fluid)) / par.k
    return spring + (H(above, fluid) - H(p_full, fluid)) / stiff - _gas_work(x, par, fluid)


def _gas_work(x: State, par: Parameters, fluid: brake_fluid.Parameters) -> float:
    """Return the energy that expanding gas has supplied to the outflow."""
    expansion, P_0 = _expanded(x, par, fluid)
    gas = par.c_stop * P_0
    moments: list[float] = [
        ops.fmax(-1.0 * x.V, 0.0),
        gas * P_0 * ops.log(expansion),
    ]  # of P^k over volume
    scale, decay = gas * P_0, 1.0 + 0.0 * expansion
    total = 0.0 * moments[1]
    for k in range(2, 4):
        scale, decay = scale * P_0, decay / expansion
        moments.append(scale * (1.0 - decay) / (k - 1))
    factor = 1.0 + 0.0 * expansion
    for j in range(1, 4):  # the terms of h: p^j / (j! beta^(j - 1)), with p = P - p_atm
        term, offset = moments[j], 1.0 + 0.0 * expansion
        for k in range(j - 1, -1, -1):
            offset = -1.0 * offset * fluid.p_atm
            term = term + math.comb(j, k) * offset * moments[k]
        total = total + factor * term / math.factorial(j)
        factor = factor / fluid.beta
    return total


def power_in(x: State, u: Input, par: Parameters, fluid: brake_fluid.Parameters) -> Power:
    """Return the power of the inflow."""
    return brake_fluid.convected_power(u.q, pressure(x, par, fluid), fluid)


@within_limits
def watch(t: Array, x: State, par: Parameters) -> list[str]:
    """Warn if the accumulator is full."""
    return first(t, par.V_max < x.V, "the accumulator is full (V_max)")
