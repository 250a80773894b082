"""The ECU of the two-wheeler: the rider's demand."""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

from bywire.brakes.two_wheeler.parameters import TwoWheelerParameters as Par
from bywire.core.signals import Signal


class Stimulus(NamedTuple):
    """What the rider demands."""

    p_f_set: Annotated[float, Signal("Pa", "front pressure demand of the rider", 2e6)]
    p_r_set: Annotated[float, Signal("Pa", "rear pressure demand of the rider", 2e6)]


class Memory(NamedTuple):
    """What the ECU holds between its ticks."""

    p_f_ref: Annotated[
        float, Signal("Pa", "front pressure set point", 2e6, set_point_of="p_f")
    ]
    p_r_ref: Annotated[
        float, Signal("Pa", "rear pressure set point", 2e6, set_point_of="p_r")
    ]


def tick(x: Any, m: Memory, u: Stimulus, par: Par) -> Memory:
    """Run the ECU once."""
    return m._replace(p_f_ref=u.p_f_set, p_r_ref=u.p_r_set)
