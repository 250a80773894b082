"""The ECU: it samples the demand, and sets the control pressure of the relay valve."""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

from bywire.authoring import Limited, Signal
from bywire.core import ops


class Stimulus(NamedTuple):
    """External inputs."""

    p_set: Annotated[float, Signal("Pa", "pressure demand", 4e5)]


class Memory(NamedTuple):
    """Memory of the ECU between its ticks."""

    p_ref: Annotated[
        float, Signal("Pa", "pressure set point", 4e5, set_point_of="p"), Limited("ecu.p_max")
    ]
    p_control: Annotated[float, Signal("Pa", "control pressure", 4e5), Limited("ecu.p_max")]


def tick(x: Any, m: Memory, u: Stimulus, par: Any) -> Memory:
    """Sample the demand; the pilot valve follows it with a lag, by backward Euler."""
    p_ref = ops.clip(u.p_set, 0.0, par.ecu.p_max)
    share = par.ecu.T_s / (par.ecu.T_s + par.ecu.T_bus)
    return Memory(p_ref=p_ref, p_control=m.p_control + share * (p_ref - m.p_control))
