"""A step from one level to another."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bywire.bench.stimulus import Level, reached
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import TimeConstant


class Parameters(ParameterSet):
    """Two levels and the time of the step."""

    start: Level
    """value before the step"""
    end: Level
    """value after the step"""
    t_step: TimeConstant
    """time of the step"""


def sample(t: NDArray[np.float64], par: Parameters) -> NDArray[np.float64]:
    """Return the step, whose value at ``t_step`` itself is ``end``."""
    return np.where(reached(t, par.t_step), par.end, par.start)
