"""What the user should know of a recording of the motorcycle brake: stops, sensors, flow."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from bywire.core.parameters import ParameterSet


def watch(recording: xr.Dataset, par: ParameterSet) -> list[str]:
    """Return the warnings of a recording, of which the signals may be a selection.

    Parameters
    ----------
    recording
        At least one row.
    par
        The run's parameters.
    """
    found: list[str] = []
    if "at_stop" in recording and "F_stop" in recording:
        far = recording["F_stop"].values > 0
        if far.any():
            first = float(recording["time"].values[int(np.argmax(far))])
            found.append(f"the piston reached its end stop at t = {first:.4g} s")
    known = par.flat()
    found += _pressed_back(recording, known) + _beyond_sensors(recording, known)
    limit = known.get("pipeline.Re_max")
    if limit is not None and "Re" in recording:
        highest = float(recording["Re"].max())
        if highest > limit:
            found.append(f"Re = {highest:.0f} in the pipeline is above {limit:g}: not laminar")
    return found


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


def _beyond_sensors(recording: xr.Dataset, known: Mapping[str, Any]) -> list[str]:
    """Return which sensors were asked to show more than their range, and when first."""
    found: list[str] = []
    if "pressure_sensor.p_high" in known and "p_mc" in recording:
        p = recording["p_mc"].values
        if known["pressure_sensor.place"] == "mid-pipeline":
            p = 0.5 * (p + recording["p_pd"].values)
        low, high = known["pressure_sensor.p_low"], known["pressure_sensor.p_high"]
        outside = (p + known["fluid.p_atm"] < low) | (p + known["fluid.p_atm"] > high)
        span = f"{low / 1e5:g} to {high / 1e5:g} bar absolute"
        found += _first(recording, outside, f"the pressure leaves the sensor's range, {span},")
    if "current_sensor.i_high" in known and "i" in recording:
        i = recording["i"].values
        low, high = known["current_sensor.i_low"], known["current_sensor.i_high"]
        outside = (i < low) | (i > high)
        span = f"{low:g} to {high:g} A"
        found += _first(recording, outside, f"the current leaves the sensor's range, {span},")
    return found


def _first(recording: xr.Dataset, happens: NDArray[np.bool_], text: str) -> list[str]:
    """Return what happens with the time of the first row that shows it, if one does."""
    if not happens.any():
        return []
    t = float(recording["time"].values[int(np.argmax(happens))])
    return [f"{text} at t = {t:.4g} s: what is measured stays at its end"]
