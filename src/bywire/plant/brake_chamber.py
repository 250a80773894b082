"""Brake chamber of an air brake: diaphragm, push rod and return spring."""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, NamedTuple

from pydantic import Field, model_validator

from bywire.core import ops
from bywire.core.faults import ParameterFault
from bywire.core.parameters import ParameterSet, RuleError
from bywire.core.quantities import Conductance, Force, Nodes, Unit
from bywire.core.signals import Energy, Power, Signal
from bywire.plant import air

DeadVolume = Annotated[float, Unit("m**3", 5e-4), Field(gt=0, allow_inf_nan=False)]
SpringStiffness = Annotated[float, Unit("N/m", 8e3), Field(ge=0, allow_inf_nan=False)]
Travel = Annotated[float, Signal("m", "travel of the rod", 0.03)]
GaugePressure = Annotated[float, Signal("Pa", "chamber pressure", 4e5)]


class Parameters(ParameterSet):
    """Massless diaphragm whose effective area depends on the travel.

    The area is interpolated between the nodes and constant outside. In a real chamber, it falls
    over the last third of the stroke.
    """

    V_0: DeadVolume
    """volume with the rod at rest, including the hose"""
    x_table: Annotated[Nodes, Unit("m", 0.02)]
    """travels of the table, increasing from 0"""
    A_table: Annotated[Nodes, Unit("m**2", 1e-2)]
    """effective areas at these travels"""
    F_s0: Force
    """preload of the return spring"""
    k_s: SpringStiffness
    """stiffness of the return spring"""
    G_leak: Conductance
    """leak conductance of the diaphragm, a volume flow at the reference state per gauge pressure"""

    @model_validator(mode="after")
    def _table_is_a_curve(self) -> Parameters:
        x, A = self.x_table, self.A_table
        if len(x) != len(A):
            valid = f"of the same length as x_table, {len(x)} nodes"
            raise RuleError("A_table", f"{len(A)} nodes", valid)
        if not x or x[0] != 0.0 or not all(a < b for a, b in pairwise(x)):
            raise RuleError("x_table", str(x), "a table that starts at 0 and increases")
        return self


FAULTS = (
    ParameterFault("weak-spring", "broken return spring", ("F_s0", "k_s"), 0.3),
    ParameterFault("torn", "torn diaphragm (value: conductance)", replaced="G_leak", value=2e-8),
)


class Input(NamedTuple):
    """Travel and speed of the rod, and gauge pressure."""

    x: Travel
    v: Annotated[float, Signal("m/s", "speed of the rod", 0.5)]
    p: GaugePressure


class InputRate(NamedTuple):
    """Derivative of the input that affects the stored energy."""

    x: Annotated[float, Signal("m/s", "speed of the rod", 0.5)]


class Output(NamedTuple):
    """Force of the rod, volume of the chamber and its rate."""

    F: Annotated[float, Signal("N", "rod force", 5e3)]
    V: Annotated[float, Signal("m**3", "chamber volume", 1e-3)]
    V_rate: Annotated[float, Signal("m**3/s", "rate of the volume", 5e-3)]


def output(u: Input, par: Parameters) -> Output:
    r"""Return force and volume.

    .. math:: F = A(x) p - F_{s0} - k_s x, \quad V = V_0 + \int_0^x A(x')\, dx'

    Notes
    -----
    The force has kinks at the nodes of the table. Without pressure, the preload holds the rod on
    its stop.
    """
    V = par.V_0 + ops.fmin(u.x, 0.0) * par.A_table[0]
    for (x0, A0), (x1, A1) in pairwise(zip(par.x_table, par.A_table, strict=True)):
        s = ops.clip(u.x, x0, x1) - x0
        V = V + s * (A0 + 0.5 * (A1 - A0) / (x1 - x0) * s)
    V = V + ops.fmax(u.x - par.x_table[-1], 0.0) * par.A_table[-1]
    A = ops.interpolate(u.x, par.x_table, par.A_table)
    return Output(F=A * u.p - par.F_s0 - par.k_s * u.x, V=V, V_rate=A * u.v)


def leak(
    p: GaugePressure, par: Parameters, gas: air.Parameters
) -> Annotated[float, Signal("kg/s", "leaking air", 1e-3)]:
    r"""Return the mass flow through the diaphragm, :math:`\dot m = G \rho_0 p`.

    It is proportional to the gauge pressure. A choked hole would pass air in proportion to the
    absolute pressure.
    """
    return par.G_leak * gas.rho_0 * p


def input_rate(u: Input) -> InputRate:
    """Return the speed of the rod, through which the spring stores energy."""
    return InputRate(x=u.v)


def energy(u: Input, par: Parameters) -> Energy:
    """Return the energy of the return spring beyond its preload."""
    return u.x * (par.F_s0 + 0.5 * par.k_s * u.x)


def power_in(u: Input, par: Parameters) -> Power:
    """Return the power of the air minus the power of the rod."""
    q = output(u, par)
    return u.p * q.V_rate - q.F * u.v
