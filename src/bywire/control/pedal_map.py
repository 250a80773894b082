"""Static map from the pedal potentiometer's voltage to the pressure set point."""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated

from pydantic import model_validator

from bywire.core import ops
from bywire.core.parameters import ParameterSet, RuleError
from bywire.core.quantities import Nodes, Unit
from bywire.core.signals import Signal


class Parameters(ParameterSet):
    """Piecewise linear map, constant outside its nodes."""

    V_nodes: Annotated[Nodes, Unit("V", 2.5)]
    """potentiometer voltages in increasing order"""
    p_nodes: Annotated[Nodes, Unit("Pa", 2e6)]
    """set points at the voltages V_nodes"""

    @model_validator(mode="after")
    def _is_a_map(self) -> Parameters:
        V, p = self.V_nodes, self.p_nodes
        if len(V) != len(p) or len(V) < 2:
            valid = f"of the same length as p_nodes, {len(p)} nodes, and at least 2"
            raise RuleError("V_nodes", f"{len(V)} nodes", valid)
        if any(a >= b for a, b in pairwise(V)):
            raise RuleError("V_nodes", str(V), "a table that increases")
        return self


def output(
    V: Annotated[float, Signal("V", "potentiometer voltage", 2.5)], par: Parameters
) -> Annotated[float, Signal("Pa", "pressure set point", 2e6)]:
    """Return the pressure set point for a potentiometer voltage."""
    return ops.interpolate(V, par.V_nodes, par.p_nodes)
