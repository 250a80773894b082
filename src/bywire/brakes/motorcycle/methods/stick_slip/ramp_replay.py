"""The whole ramp once more, with what was identified."""

from __future__ import annotations

import xarray as xr

from bywire.brakes.motorcycle.model import MotorcycleBrake
from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.brakes.motorcycle.trim import memory_at, state_at
from bywire.identification.output_error import trial
from bywire.simulation.run import simulate


def replayed(data: xr.Dataset, par: MotorcycleParameters, step: float) -> xr.Dataset:
    """Return the pressure over the whole ramp, measured and modeled, driven by the current.

    Parameters
    ----------
    data
        ``i`` [A] and ``p_mc`` [Pa] over ``time`` [s].
    step
        Substep [s].
    """
    own = par.replace({"drive.mode": "current-source"})
    start = max(float(data["p_mc"][0]), 0.0)
    whole = trial(
        MotorcycleBrake(), own, data, {"i_set": "i"}, {"p_mc": 1.0}, state=state_at(start, own),
        memory=memory_at(start, own), step=step,
    )  # fmt: skip
    modeled = simulate(whole.run, ("p_mc",))["p_mc"]
    attrs = {"units": "Pa", "long_name": "master-cylinder pressure"}
    return xr.Dataset(
        {"measured": ("time", data["p_mc"].values, attrs), "modeled": ("time", modeled, attrs)},
        {"time": data["time"]},
    )
