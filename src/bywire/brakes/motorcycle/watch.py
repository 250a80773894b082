"""What a recording of the motorcycle brake shows that no element can say: its stops."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr

from bywire.core.parameters import ParameterSet

WATCHED = ("at_stop", "F_stop", "i", "p_pd")
"""what `watch` looks at"""


def watch(recording: xr.Dataset, par: ParameterSet) -> list[str]:
    """Return the warnings of a recording, of which the signals may be a selection.

    ``recording``: at least one row.
    """
    warnings: list[str] = []
    if "at_stop" in recording and "F_stop" in recording:
        far = recording["F_stop"].values > 0
        if far.any():
            first = float(recording["time"].values[int(np.argmax(far))])
            warnings.append(f"the piston reached its end stop at t = {first:.4g} s")
    return warnings + _pressed_back(recording, par.choices())


def may_warn(rows: Any) -> list[int]:
    """Return the cases of which `watch` says something; ``rows``: shape (cases, rows) each."""
    speaks: Any = False
    if "F_stop" in rows:
        force = rows["F_stop"].values
        speaks = (force > 0).any(axis=-1) | (force[..., -1] < 0)
    return np.flatnonzero(speaks).tolist()


def _pressed_back(recording: xr.Dataset, known: Mapping[str, Any]) -> list[str]:
    """Return whether current pulls the piston against its retracted stop at the end."""
    if "port.law" not in known or not {"F_stop", "i", "p_pd"} <= set(recording):
        return []
    F, i, p = (float(recording[name].values[-1]) for name in ("F_stop", "i", "p_pd"))
    if not (F < 0.0 and i < 0.0):
        return []
    text = f"at the end {i:.3g} A pull the piston against its retracted stop"
    if known["port.law"] == "makeup":
        text += (
            f", with {p / 1e5:.2g} bar left in the caliper: the compensation port is not modeled "
            "(port.law = 'makeup'), port.law = 'dead-stroke' lets the fluid out"
        )
    return [text]
