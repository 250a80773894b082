"""Low-pressure accumulator of an anti-lock system, where a sprung piston stores released fluid."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from pydantic import Field

from bywire.core.faults import ParameterFault
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Pressure, Unit
from bywire.core.signals import Energy, Power, Signal
from bywire.core.typing import Array
from bywire.core.validity import first, row_by_row
from bywire.plant import brake_fluid

Stiffness = Annotated[float, Unit("Pa/m**3", 1e11), Field(gt=0, allow_inf_nan=False)]
Capacity = Annotated[float, Unit("m**3", 3.5e-6), Field(gt=0, allow_inf_nan=False)]


class Parameters(ParameterSet):
    """Massless piston between two stops, incompressible fluid."""

    p_0: Pressure
    """pressure at which the spring starts to yield"""
    k: Stiffness
    """pressure per volume"""
    V_max: Capacity
    """maximum volume"""


FAULTS = (ParameterFault("stiff", "stuck piston", ("k",), 10.0),)


class State(NamedTuple):
    """Stored volume."""

    V: Annotated[float, Signal("m**3", "stored volume", 1e-6, low=0.0)]


class Input(NamedTuple):
    """Flow in."""

    q: Annotated[float, Signal("m**3/s", "flow in", 1e-5)]


def mass(x: State) -> Annotated[float, Signal("1", "one", 1.0)]:
    """Return the factor of the volume's derivative, 1."""
    return 1.0


def balance(u: Input) -> Annotated[float, Signal("m**3/s", "flow in", 1e-5)]:
    """Return the rate of the volume. The model limits the volume at both ends."""
    return u.q


def pressure(x: State, par: Parameters) -> Annotated[float, Signal("Pa", "pressure", 2e5)]:
    r"""Return the pressure, :math:`p = p_0 + k V`.

    Notes
    -----
    An empty accumulator has any pressure from 0 to ``p_0``. Its spring rests on a stop.
    """
    return par.p_0 + par.k * x.V


def energy(x: State, par: Parameters, fluid: brake_fluid.Parameters) -> Energy:
    """Return the energy of the spring, and of the fluid that arrived at its pressure."""
    H = brake_fluid.flow_energy_integral
    p = pressure(x, par)
    return (H(p, fluid) - H(par.p_0, fluid)) / par.k


def power_in(x: State, u: Input, par: Parameters, fluid: brake_fluid.Parameters) -> Power:
    """Return the power of the inflow."""
    return brake_fluid.convected_power(u.q, pressure(x, par), fluid)


@row_by_row
def watch(t: Array, x: State, par: Parameters) -> list[str]:
    """Warn if the volume exceeds that of the full accumulator."""
    return first(t, par.V_max < x.V, "the accumulator is full (V_max)")
