"""What the wedge brake's real-time computer can compute to see a failure.

They are looked at while the demanded moment is steady: a gap that is crossed, or a ramp, makes all
of them large in a healthy brake.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from bywire.brakes.wedge.model import WedgeBrake
from bywire.campaigns.lasting import largest_of_the_last, least_of_the_last, mean_of_the_last
from bywire.campaigns.residual import NEVER, Residual
from bywire.core.typing import Array

NAME = WedgeBrake.name
Signals = Mapping[str, Array]
_STEADY = 0.1  # s after which a step of the demand is over
_AVERAGE = 10e-3  # s, over which contacts and free-play are averaged


def _steady(signals: Signals, dt: float, values: Array) -> Array:
    """Return the mean of a residual where the demand has not changed for a while, else none."""
    rows, M_set = round(_STEADY / dt), signals["M_set"]
    still = largest_of_the_last(M_set, rows) - least_of_the_last(M_set, rows) <= 0
    return np.where(still, mean_of_the_last(values, max(round(_AVERAGE / dt), 1)), NEVER)


def _moment(signals: Signals, par: Any, dt: float) -> Array:
    return _steady(signals, dt, np.abs(signals["M_set"] - signals["M_meas"]))


def _difference(signals: Signals, par: Any, dt: float) -> Array:
    """Return how differently both motors are asked: against each other beyond the preload."""
    return _steady(signals, dt, np.abs(signals["i_1_ref"] - signals["i_2_ref"]))


def _effort(signals: Signals, par: Any, dt: float) -> Array:
    return _steady(signals, dt, np.maximum(abs(signals["i_1_ref"]), abs(signals["i_2_ref"])))


RESIDUALS = (
    Residual("moment-error", "demanded and measured moment", NAME, "N*m", ("M_set", "M_meas"),
             _moment, hold=10e-3),
    Residual("motor-difference", "demands of both motors", NAME, "A",
             ("i_1_ref", "i_2_ref", "M_set"), _difference, hold=5e-3),
    Residual("effort", "the larger demand of both motors", NAME, "A",
             ("i_1_ref", "i_2_ref", "M_set"), _effort, hold=5e-3),
)  # fmt: skip
