"""Reservoir port of the master cylinder, with makeup flow and an optional dead stroke."""

from __future__ import annotations

from typing import Annotated, Literal, NamedTuple

from bywire.core import ops
from bywire.core.faults import ParameterFault
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Conductance, Length
from bywire.core.signals import Power, Signal
from bywire.plant import brake_fluid

Stroke = Annotated[float, Signal("m", "stroke from the retracted end", 1e-3)]


class Parameters(ParameterSet):
    """Port between chamber and reservoir.

    With any law, the cup seal admits fluid if the pressure would otherwise fall below ambient (the
    model's one-sided limit). With ``law = "dead-stroke"``, an orifice is also open until the piston
    has moved ``x_port`` from its retracted end. With ``law = "leaking"``, the cup seal leaks fluid
    back in every stroke.
    """

    law: Literal["makeup", "dead-stroke", "leaking"]
    """whether the piston uncovers a port near its retracted end, or its cup seal leaks"""
    x_port: Length
    """stroke from the retracted end at which the piston covers the port (law "dead-stroke")"""
    G_port: Conductance
    """conductance of the fully open port (law "dead-stroke"), or of the leak (law "leaking")"""


FAULTS = (
    ParameterFault("blocked", "no fluid returns through the open port", ("G_port",), 0.0),
    ParameterFault(
        "leaking",
        "the cup seal leaks fluid back (value: conductance)",
        replaced="G_port",
        value=1e-13,
        with_it={"law": "leaking"},
    ),
)


class Input(NamedTuple):
    """Piston stroke from the retracted end, and chamber pressure."""

    x: Stroke
    p: Annotated[float, Signal("Pa", "master-cylinder pressure", 1e5)]


class Output(NamedTuple):
    """Conductance of the port."""

    G: Annotated[float, Signal("m**3/(s*Pa)", "port conductance", 1e-12)]


def closed_at(par: Parameters) -> Stroke:
    """Return the stroke from the retracted end beyond which a slow piston builds up pressure."""
    return par.x_port if par.law == "dead-stroke" else 0.0 * par.x_port


def output(u: Input, par: Parameters) -> Output:
    """Return the conductance, which falls linearly to 0 while the piston covers the port."""
    if par.law == "makeup":
        return Output(G=0.0 * par.G_port)
    if par.law == "leaking":
        return Output(G=par.G_port)
    return Output(G=par.G_port * ops.clip(1.0 - u.x / par.x_port, 0.0, 1.0))


def power_loss(u: Input, par: Parameters, fluid: brake_fluid.Parameters) -> Power:
    """Return the power lost with the flow into the reservoir, >= 0."""
    return brake_fluid.convected_power(output(u, par).G * u.p, u.p, fluid)
