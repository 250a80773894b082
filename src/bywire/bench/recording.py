"""Trajectories as recordings: datasets with units, names and where they come from."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr
from numpy.typing import NDArray

from bywire import __version__
from bywire.bench.wedge_watch import watch_wedge
from bywire.core.parameters import ParameterSet
from bywire.core.signals import signals_of
from bywire.simulation.run import Run, Trajectory


def parameter_hash(par: ParameterSet) -> str:
    """Return a short digest of all values and choices."""
    text = json.dumps(par.flat(), sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def record(
    run: Run, trajectory: Trajectory, settle: float, keep: float, notes: Mapping[str, Any]
) -> xr.Dataset:
    """Return the recording of a run.

    Parameters
    ----------
    settle
        Time of the run [s] that lies before the recording's zero.
    keep
        How much of it is kept, at negative times.
    notes
        Further attributes, for instance the experiment's name.

    Returns
    -------
    xarray.Dataset
        Dimension ``time`` [s]; variables with ``units`` and ``long_name``.
    """
    time = trajectory.time - settle
    kept = time >= -keep - 1e-9
    signals = signals_of(run.model.Output)
    variables = {
        name: ("time", trajectory[name][kept], {"units": s.unit, "long_name": s.label})
        for name, s in signals.items()
        if name in trajectory.names
    }
    # As an index of pandas: from an array, xarray would load pint to see what it is.
    axis = pd.Index(np.round(time[kept], 12), name="time")
    recording = xr.Dataset(variables, coords={"time": ("time", axis, {"units": "s"})})
    recording["time"].attrs["long_name"] = "time"
    warnings = watch(recording, run.par, trajectory)
    recording.attrs = {
        "bywire_version": __version__,
        "model": run.model.name,
        "parameter_hash": parameter_hash(run.par),
        "parameters": run.par.model_dump_json(),
        "step": run.step,
        "engine": trajectory.engine,
        "status": trajectory.status,
        "unsettled_substeps": trajectory.unsettled,
        "repeated_substeps": trajectory.repeated,
        "warnings": "; ".join(warnings),
        **notes,
    }
    return recording


def watch(recording: xr.Dataset, par: ParameterSet, trajectory: Trajectory) -> list[str]:
    """Return what the user should know of a recording: validity left, stops met, solver trouble."""
    found: list[str] = []
    if not recording.sizes["time"]:  # interrupted before the first row
        return found
    if trajectory.doubt:
        found.append(trajectory.doubt.replace("; ", ", "))  # what joins the warnings
    if trajectory.unsettled:
        found.append(
            f"{trajectory.unsettled} substeps hit the cap of the contact iteration: "
            "take a smaller step"
        )
    if "at_stop" in recording and "F_stop" in recording:
        far = recording["F_stop"].values > 0
        if far.any():
            first = float(recording["time"].values[int(np.argmax(far))])
            found.append(f"the piston reached its end stop at t = {first:.4g} s")
    known = par.flat()
    found += _pressed_back(recording, known) + _beyond_sensors(recording, known)
    found += watch_wedge(recording, known)
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


def energy_residual(recording: xr.Dataset) -> xr.DataArray:
    """Return energy in, less losses, less the change of stored energy [J]; 0 but for the step."""
    losses = sum(
        recording[name]
        for name in recording
        if str(name).startswith("E_") and name not in ("E_source", "E_stored")
    )
    start = {"time": 0}
    balance = recording["E_source"] - losses - recording["E_stored"]
    residual: xr.DataArray = balance - balance.isel(start)
    residual.attrs = {"units": "J", "long_name": "residual of the energy balance"}
    return residual
