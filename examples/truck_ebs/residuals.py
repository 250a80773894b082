"""Residuals with which the ECU can detect faults of valve, chamber, pilot valve and sensor."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bywire.authoring import Residual, largest_of_the_last, least_of_the_last

Array = NDArray[np.float64]
_SPAN = 1.0  # s: time in which a healthy brake reaches a set point, or releases


def _pressure(signals: Mapping[str, Array], par: Any, dt: float) -> Array:
    """Return the distance of the pressure from the range of the recent set points.

    It is zero until there are enough of them.
    """
    rows, p = round(_SPAN / dt), signals["p_meas"]
    above = p - largest_of_the_last(signals["p_ref"], rows)
    below = least_of_the_last(signals["p_ref"], rows) - p
    outside = np.maximum(np.maximum(above, below), 0.0)
    outside[:, :rows] = 0.0
    return outside


def _correction(signals: Mapping[str, Array], par: Any, dt: float) -> Array:
    """Return the magnitude of the correction by the pressure control."""
    return np.abs(signals["integral"])


RESIDUALS = (
    Residual(
        "pressure",
        "measured pressure and the set points of the last second",
        ("truck-ebs", "truck-park"),
        "Pa",
        ("p_ref", "p_meas"),
        _pressure,
        hold=20e-3,
    ),
    Residual(
        "correction",
        "correction that the relay valve needs to reach the set point",
        ("truck-ebs", "truck-park"),
        "Pa",
        ("integral",),
        _correction,
        hold=0.1,
    ),
)
