r"""Piston of a hydraulic caliper with its fluid, for pads that it does not always touch.

Use it instead of `stiffening_caliper` if running clearance, knock-back or the roll-back of the seal
(`seal_rollback`) matter. The pads are the far side of an `end_stop`, whose stiffness is that of
pads and caliper, and the near side is the bottom of the bore. Their load is an input.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from annotated_types import Ge
from pydantic import Field

from bywire.core.faults import ParameterFault
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Area, Conductance, Damping, Mass, Unit
from bywire.core.signals import Energy, Power, Role, Signal
from bywire.core.typing import Array
from bywire.core.validity import within_limits
from bywire.plant import brake_fluid

FluidVolume = Annotated[float, Unit("m**3", 1e-5), Field(gt=0, allow_inf_nan=False)]
Loss = Annotated[
    float, Signal("W", "damping and leak of the caliper", role=Role("sink", "caliper"))
]


class Parameters(ParameterSet):
    """Rigid piston in a rigid housing, in gauge pressures. Damping includes that of the pads."""

    A_pd: Area
    """piston area"""
    V_0: FluidVolume
    """volume of the fluid in caliper and line while the piston is retracted"""
    m: Mass
    """mass of piston and pads"""
    d: Damping
    """viscous damping"""
    G_leak: Conductance
    """leak to the outside, 0 for a tight seal"""


FAULTS = (
    ParameterFault(
        "leaking",
        "fluid leaks past the seal (value: conductance)",
        replaced="G_leak",
        value=1e-13,
    ),
)


class State(NamedTuple):
    """Pressure, travel and speed."""

    p: Annotated[float, Signal("Pa", "caliper pressure", 2e6), Ge(0)]
    x: Annotated[float, Signal("m", "travel of the caliper's piston", 2e-4)]
    v: Annotated[float, Signal("m/s", "speed of the caliper's piston", 0.01)]


class Factors(NamedTuple):
    """Factors of the derivatives."""

    p: Annotated[float, Signal("m**3/Pa", "compliance of the fluid", 1e-14)]
    x: Annotated[float, Signal("1", "unity")]
    v: Annotated[float, Signal("kg", "mass", 0.3)]


class Balance(NamedTuple):
    """Right-hand sides of the states."""

    p: Annotated[float, Signal("m**3/s", "flow that compresses the fluid", 1e-5)]
    x: Annotated[float, Signal("m/s", "speed of the caliper's piston", 0.01)]
    v: Annotated[float, Signal("N", "force on the caliper's piston", 1e3)]


class Input(NamedTuple):
    """Flow in, and loads of pads and seal."""

    q: Annotated[float, Signal("m**3/s", "flow in", 1e-5)]
    F_pads: Annotated[float, Signal("N", "load of pads and bore", 1e3)]
    F_seal: Annotated[float, Signal("N", "load of the seal", 100.0)]


def volume(x: State, par: Parameters) -> Annotated[float, Signal("m**3", "volume", 1e-5)]:
    r"""Return the volume of the fluid, :math:`V_0 + A_{pd} x`."""
    return par.V_0 + par.A_pd * x.x


def _chamber(x: State, par: Parameters) -> brake_fluid.Chamber:
    return brake_fluid.Chamber(V=volume(x, par), p=x.p)


def mass(x: State, par: Parameters, fluid: brake_fluid.Parameters) -> Factors:
    """Return the factors of the derivatives: compliance of the fluid, 1, and the mass."""
    return Factors(p=brake_fluid.compliance(_chamber(x, par), fluid), x=1.0, v=par.m)


def balance(x: State, u: Input, par: Parameters) -> Balance:
    r"""Return the right-hand sides.

    .. math::
        \frac{V}{\beta} \dot p = q - G_{leak}\, p - A_{pd} v, \quad
        m \dot v = A_{pd}\, p - F_{pads} - F_{seal} - d\, v
    """
    return Balance(
        p=u.q - par.G_leak * x.p - par.A_pd * x.v,
        x=x.v,
        v=par.A_pd * x.p - u.F_pads - u.F_seal - par.d * x.v,
    )


def energy(x: State, par: Parameters, fluid: brake_fluid.Parameters) -> Energy:
    """Return the kinetic energy, and that of the compressed fluid."""
    return 0.5 * par.m * x.v * x.v + brake_fluid.compression_energy(_chamber(x, par), fluid)


def power_in(x: State, u: Input, par: Parameters, fluid: brake_fluid.Parameters) -> Power:
    """Return the power of the inflow, minus that on pads and seal."""
    return brake_fluid.convected_power(u.q, x.p, fluid) - (u.F_pads + u.F_seal) * x.v


def power_loss(x: State, par: Parameters, fluid: brake_fluid.Parameters) -> Loss:
    """Return the heat from damping, and the power that leaves with the leak, >= 0."""
    leak = brake_fluid.convected_power(par.G_leak * x.p, x.p, fluid)
    return par.d * x.v * x.v + leak


@within_limits
def watch(t: Array, x: State, fluid: brake_fluid.Parameters) -> list[str]:
    """Warn if the absolute pressure is below zero."""
    return brake_fluid.watch(t, x.p, fluid, "in the caliper")
