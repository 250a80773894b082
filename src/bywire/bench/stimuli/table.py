"""A table of times and values, for example from a recorded pedal signal."""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from bywire.bench.stimulus import TOLERANCE
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Unit

Numbers = tuple[Annotated[float, Field(allow_inf_nan=False)], ...]


class Parameters(ParameterSet):
    """Nodes and interpolation."""

    times: Annotated[Numbers, Unit("s")]
    """times of the nodes, in increasing order"""
    values: Annotated[Numbers, Unit("level")]
    """values at these times"""
    between: Literal["linear", "hold"]
    """interpolation between two nodes: a straight line, or hold the earlier value"""

    @model_validator(mode="after")
    def _is_a_table(self) -> Parameters:
        t, u = self.times, self.values
        if len(t) != len(u) or not t:
            raise ValueError(
                f"times and values must have the same length >= 1, got {len(t)} and {len(u)}"
            )
        for a, b in pairwise(t):
            if a >= b:
                raise ValueError(f"times must be in increasing order, got {b:g} s after {a:g} s")
        return self


def sample(t: NDArray[np.float64], par: Parameters) -> NDArray[np.float64]:
    """Return the table's values, constant beyond its ends."""
    if par.between == "linear":
        return np.interp(t, par.times, par.values)
    passed = np.searchsorted(np.asarray(par.times), t + TOLERANCE, side="right") - 1
    return np.asarray(par.values)[np.maximum(passed, 0)]
