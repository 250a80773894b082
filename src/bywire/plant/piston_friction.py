"""Friction between the caliper's piston and its seal: pressure that does not move the pads.

A massless piston whose friction depends on its speed would chatter. Here the flow is set-valued.
Fluid moves the piston in if the line pressure exceeds the pad pressure by more than the friction,
and out if it is lower by more than the friction. In between, the piston is at rest and the flow is
zero. Both flows are one-sided contact forces, whose compliance is the line's resistance.
"""

from __future__ import annotations

from typing import Annotated, Literal, NamedTuple

from annotated_types import Ge

from bywire.core import ops
from bywire.core.faults import ParameterFault
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Force, Weight
from bywire.core.signals import FlowResistance, Power, Signal
from bywire.plant import brake_fluid
from bywire.plant import caliper as pads
from bywire.plant import pipeline as line

Pressure = Annotated[float, Signal("Pa", "pressure", 1e5)]
Flow = Annotated[float, Signal("m**3/s", "flow into the caliper", 1e-6)]


class Parameters(ParameterSet):
    """Coulomb friction of a piston, and the elasticity of its seal.

    ``law``: with ``"sticking"``, the piston has friction; with ``"off"``, it has none.
    """

    law: Literal["off", "sticking"]
    """whether the piston sticks"""
    F_fr: Force
    """friction force on the piston"""
    rollback: Weight
    """fraction of the friction with which the deformed seal retracts the piston, 0 if seized"""


FAULTS = (
    ParameterFault(
        "stuck",
        "the piston sticks in its seal (value: friction force)",
        replaced="F_fr",
        value=60.0,
        with_it={"law": "sticking"},
    ),
)


class Input(NamedTuple):
    """Pressures at both ends of line and piston."""

    p_line: Annotated[float, Signal("Pa", "pressure at the start of the line", 2e6)]
    p_pads: Annotated[float, Signal("Pa", "pressure of the pads", 2e6)]


class Forces(NamedTuple):
    """Flows, both >= 0. They solve the same complementarity problem as contact forces."""

    inward: Annotated[float, Signal("m**3/s", "flow that moves the piston in", 1e-6), Ge(0)]
    outward: Annotated[float, Signal("m**3/s", "flow that moves the piston out", 1e-6), Ge(0)]


class Overlaps(NamedTuple):
    """Pressure differences beyond the friction."""

    inward: Annotated[float, Signal("Pa", "pressure beyond friction, inward", 1e5)]
    outward: Annotated[float, Signal("Pa", "pressure beyond friction, outward", 1e5)]


class Thresholds(NamedTuple):
    """Pressure differences that friction can hold."""

    inward: Annotated[float, Signal("Pa", "friction per unit area, inward", 1e5)]
    outward: Annotated[float, Signal("Pa", "friction per unit area, outward", 1e5)]


def exists(par: Parameters) -> bool:
    """Return whether there are contacts. A sticking piston needs them."""
    return par.law == "sticking"


def thresholds(par: Parameters, caliper: pads.Parameters) -> Thresholds:
    r"""Return the pressures that friction can hold, :math:`F_{fr}/A`, outward minus rollback."""
    taken = par.F_fr / caliper.A_pd
    return Thresholds(inward=taken, outward=(1.0 - par.rollback) * taken)


def overlaps(u: Input, par: Parameters, caliper: pads.Parameters) -> Overlaps:
    """Return the pressures that drive the flows of a sticking piston."""
    taken = thresholds(par, caliper)
    return Overlaps(
        inward=u.p_line - u.p_pads - taken.inward,
        outward=u.p_pads - u.p_line - taken.outward,
    )


def compliance(pipeline: line.Parameters, fluid: brake_fluid.Parameters) -> FlowResistance:
    """Return the pressure drop per flow, which is the line resistance."""
    return line.resistance(pipeline, fluid)


def flow(f: Forces) -> Flow:
    """Return the flow into the caliper with a sticking piston."""
    return f.inward - f.outward


def fluid_pressure(u: Input, par: Parameters, caliper: pads.Parameters) -> Pressure:
    """Return the caliper pressure, which is pad pressure plus pressure held by friction."""
    if par.law == "off":
        return u.p_pads
    taken = thresholds(par, caliper)
    return u.p_pads + ops.clip(u.p_line - u.p_pads, -taken.outward, taken.inward)


def power_loss(
    u: Input, f: Forces, par: Parameters, caliper: pads.Parameters, fluid: brake_fluid.Parameters
) -> Power:
    """Return the friction heat, including released compression energy, >= 0.

    It equals the flow's power at fluid pressure minus its power at pad pressure.
    """
    if par.law == "off":
        return 0.0
    taken, h = thresholds(par, caliper), brake_fluid.flow_energy
    p = u.p_pads
    return f.inward * (h(p + taken.inward, fluid) - h(p, fluid)) + f.outward * (
        h(p, fluid) - h(p - taken.outward, fluid)
    )
