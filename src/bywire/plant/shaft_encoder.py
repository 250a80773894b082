"""Incremental encoder on a motor shaft."""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import Field

from bywire.core import ops
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Unit
from bywire.core.signals import Signal

Angle = Annotated[float, Signal("rad", "motor angle", 3.0)]


class Parameters(ParameterSet):
    """Edge counter that loses no edges. The reading is the nearest count."""

    law: Literal["ideal", "quantized"]
    """whether the angle is rounded to whole counts"""
    counts: Annotated[float, Unit("1", 16384.0), Field(gt=0, allow_inf_nan=False)]
    """counts per revolution, all edges"""


def reading(theta: Angle, par: Parameters) -> Angle:
    """Return the angle that the counter reads."""
    if par.law == "ideal":
        return theta
    count = 2.0 * math.pi / par.counts
    return count * ops.floor(theta / count + 0.5)
