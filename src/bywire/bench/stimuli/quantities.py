"""Quantities of stimuli, and when an instant counts as reached.

A stimulus may drive a current, a voltage, a pressure or a force. Its levels therefore carry the
unit ``level``, which the registry replaces by the unit of the driven signal. Every stimulus is a
function ``sample(t, par)``: times [s] of any shape give the driven signal [level] in that shape.
"""

from __future__ import annotations

from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from bywire.core.quantities import Unit

Level = Annotated[float, Unit("level"), Field(allow_inf_nan=False)]
Amplitude = Annotated[float, Unit("level"), Field(ge=0, allow_inf_nan=False)]
LevelRate = Annotated[float, Unit("level/s"), Field(gt=0, allow_inf_nan=False)]
Phase = Annotated[float, Unit("rad"), Field(allow_inf_nan=False)]
Count = Annotated[int, Unit("1", 16.0), Field(ge=1, le=10_000)]

TOLERANCE = 1e-9  # s: ticks at k * T carry rounding errors far below it


def reached(t: NDArray[np.float64], instant: float) -> NDArray[np.bool_]:
    """Return where the time has reached an instant, rounding errors of a tick forgiven.

    ``t``: times [s], any shape; ``instant``: instant [s].
    """
    return t >= instant - TOLERANCE
