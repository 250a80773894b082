"""Warnings about the motorcycle brake's stops, in addition to its elements' warnings."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from bywire.core.parameters import ParameterSet
from bywire.core.validity import outline

if TYPE_CHECKING:
    import xarray as xr

WATCHED = ("at_stop", "F_stop", "i", "p_pd")


def stop_warnings(recording: xr.Dataset, par: ParameterSet) -> list[str]:
    """Return the warnings about a recording of at least one row, which may lack signals."""
    warnings: list[str] = []
    if "at_stop" in recording and "F_stop" in recording:
        at_far_stop = recording["F_stop"].values > 0
        if at_far_stop.any():
            first = float(recording["time"].values[int(np.argmax(at_far_stop))])
            warnings.append(f"the piston reached its end stop at t = {first:.4g} s")
    return warnings + _pulled_back(recording, par.choices())


def cases_at_stops(rows: Any) -> list[int]:
    """Return the cases with a warning about a stop; ``rows``: signals of shape (cases, rows)."""
    if "F_stop" not in rows:
        return []
    force = outline(rows, "F_stop")
    return np.flatnonzero((force > 0).any(axis=-1) | (force[..., -1] < 0)).tolist()


def _pulled_back(recording: xr.Dataset, choices: Mapping[str, Any]) -> list[str]:
    """Return a warning if the final current pulls the piston against its retracted stop."""
    if "port.law" not in choices or not {"F_stop", "i", "p_pd"} <= set(recording):
        return []
    F, i, p = (float(recording[name].values[-1]) for name in ("F_stop", "i", "p_pd"))
    if not (F < 0.0 and i < 0.0):
        return []
    text = f"at the end, {i:.3g} A pull the piston against its retracted stop"
    if choices["port.law"] == "makeup":
        text += (
            f", with {p / 1e5:.2g} bar remaining in the caliper. port.law = 'makeup' does not "
            "model the compensation port. Use port.law = 'dead-stroke' to let the fluid out"
        )
    return [text]
