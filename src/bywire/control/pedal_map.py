"""Static map from the pedal's potentiometer to the pressure set point."""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated

from pydantic import model_validator

from bywire.core import ops
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Nodes, Unit
from bywire.core.signals import Signal


class Parameters(ParameterSet):
    """Piecewise linear map, constant outside its nodes."""

    V_nodes: Annotated[Nodes, Unit("V", 2.5)]
    """potentiometer voltages, increasing"""
    p_nodes: Annotated[Nodes, Unit("Pa", 2e6)]
    """set points at these voltages"""

    @model_validator(mode="after")
    def _is_a_map(self) -> Parameters:
        V, p = self.V_nodes, self.p_nodes
        if len(V) != len(p) or len(V) < 2:
            raise ValueError(
                f"pedal_map needs V_nodes and p_nodes of one length >= 2, got {len(V)} and {len(p)}"
            )
        if any(a >= b for a, b in pairwise(V)):
            raise ValueError(f"pedal_map.V_nodes must increase, got {V}")
        return self


def output(
    V: Annotated[float, Signal("V", "potentiometer voltage", 2.5)], par: Parameters
) -> Annotated[float, Signal("Pa", "pressure set point", 2e6)]:
    """Return the pressure set point for a potentiometer voltage."""
    return ops.interpolate(V, par.V_nodes, par.p_nodes)
