"""Residuals that the brake's ECU can compute from its sensors and its estimate."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bywire.authoring import NEVER, Residual, mean_of_the_last

Array = NDArray[np.float64]

_BOTH = ("emb-caliper", "emb-caliper-pmsm")
_WINDOW = 5e-3  # s, several samples of the force control


def _plausible(signals: Mapping[str, Array], par: Any, dt: float) -> Array:
    """Return the difference between load cell and estimate, if there is an estimate."""
    apart = np.abs(signals["F_meas"] - signals["F_hat"])
    return apart if par.ecu.estimation == "on" else np.full(apart.shape, NEVER)


def _follows(signals: Mapping[str, Array], par: Any, dt: float) -> Array:
    """Return the speed error while the demanded current is not saturated."""
    error = mean_of_the_last(
        np.abs(signals["omega_ref"] - signals["omega"]), max(round(_WINDOW / dt), 1)
    )
    return np.where(signals["sat_current"] < 0.5, error, NEVER)


RESIDUALS = (
    Residual(
        "force-plausibility",
        "load cell and estimated clamp force",
        _BOTH,
        "N",
        ("F_meas", "F_hat"),
        _plausible,
        hold=10e-3,
    ),
    Residual(
        "speed-error",
        "demanded and measured motor speed",
        _BOTH,
        "rad/s",
        ("omega_ref", "omega", "sat_current"),
        _follows,
        hold=20e-3,
    ),
)
