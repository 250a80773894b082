"""Replay: the measured demand drives the model, and its answer is laid beside the measured one."""

from __future__ import annotations

from collections.abc import Mapping

import xarray as xr

from bywire.assemblies.motorcycle_brake import MotorcycleBrake
from bywire.assemblies.motorcycle_parameters import MotorcycleParameters
from bywire.assemblies.motorcycle_trim import memory_at, state_at
from bywire.identification.output_error import trial
from bywire.simulation.run import simulate


def replayed(
    par: MotorcycleParameters,
    data: xr.Dataset,
    inputs: Mapping[str, str],
    output: str,
    step: float,
) -> xr.Dataset:
    """Return ``measured`` and ``modeled`` over time."""
    start = max(float(data[output][0]), 0.0)
    one = trial(
        MotorcycleBrake(), par, data, inputs, {output: 1.0}, state=state_at(start, par),
        memory=memory_at(start, par), step=step,
    )  # fmt: skip
    modeled = simulate(one.run, (output,))[output]
    attrs = {"units": data[output].attrs.get("units", "1"), "long_name": output}
    return xr.Dataset(
        {"measured": ("time", data[output].values, attrs), "modeled": ("time", modeled, attrs)},
        {"time": data["time"]},
    )
