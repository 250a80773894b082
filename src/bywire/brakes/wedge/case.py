"""What the wedge brake's experiments share: runs that start parked, and key figures of braking."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import xarray as xr

from bywire.bench.energy_ledger import energy_residual
from bywire.bench.experiment import Case
from bywire.bench.kpis.kpi import Figures, Kpi
from bywire.brakes.wedge.elements import wedge
from bywire.brakes.wedge.laws.moment_control import PARKED
from bywire.brakes.wedge.model import WedgeBrake, state_at
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.brakes.wedge.rows import along_disc
from bywire.brakes.wedge.start import memory_at
from bywire.core.typing import Array

Signals = Mapping[str, Array]

BRAKING = Figures(
    contact_time=("s", "Time until the pads press on the disc."),
    time_to_90=("s", "Time until the moment sensor first shows 90 % of the demand."),
    peak_power=("W", "Largest power at the drives' input."),
    peak_power_filtered=("W", "Largest power at the drives' input, as the rig measures it."),
    peak_normal_force=("N", "Largest normal force."),
    caliper_energy=("J", "Largest energy of the caliper before the demand changes."),
    disc_share=("%", "Work of the disc on the wedge until then, over that energy."),
    rate_limited=("%", "Share of the time until the demand changes on the software rate limit."),
    peak_speed=("rad/s", "Largest speed of motor 1."),
    energy_in=("J", "Energy at the drives' input, standby included."),
    energy_braked=("J", "Energy taken from the disc."),
    energy_left=("J", "Largest residual of the energy balance: the step's error."),
    undefined="the level is never reached in time",
)
"""key figures of :func:`braking`"""


def case_from_parked(
    par: WedgeParameters,
    stimulus: Callable[[Array], Signals],
    duration: float,
    changes: Mapping[str, Any] | None = None,
    label: str = "run",
    **timing: float,
) -> Case:
    """Return the run of an experiment that starts parked, preloaded, without current.

    Parameters
    ----------
    changes
        Parameters that the experiment sets; the command mode is "moment" unless given.
    timing
        ``settle``, ``keep`` and ``record`` of the case [s].
    """
    changed = par.replace({"command.mode": "moment", **(changes or {})})
    return Case(
        label=label,
        model=WedgeBrake(),
        par=changed,
        state=state_at(0.0, changed),
        memory=memory_at(0.0, changed),
        stimulus=stimulus,
        duration=duration,
        start=lambda par: (state_at(0.0, par), memory_at(0.0, par)),
        **timing,
    )


def steps(t: Array, levels: Mapping[float, float]) -> Array:
    """Return a signal that takes each level from its time [s] on, and zero before the first."""
    y = np.zeros(t.shape)
    for begin, level in sorted(levels.items()):
        y = np.where(t >= begin - 1e-9, level, y)
    return y


def braking(run: xr.Dataset, target: float, end: float) -> tuple[Kpi, ...]:
    """Return the key figures of a braking that begins at time zero, in the disc's direction.

    ``target``: moment demanded [N m]; ``end``: time [s] at which the demand changes for the first
    time.
    """
    run = along_disc(run)
    after = run.sel(time=slice(-1e-9, None))
    held = run.sel(time=slice(-1e-9, end + 1e-9))
    peak = int(np.argmax(held["U_caliper"].values))
    stored = float(held["U_caliper"].values[peak])
    work = float(held["W_disc"].values[peak] - held["W_disc"].values[0])
    share = (
        (100.0 * work / stored, "") if stored > 0 else (math.nan, "the caliper stores no energy")
    )
    return BRAKING(
        contact_time=_contact(held),
        time_to_90=first(held, "y_M", 0.9 * target),
        peak_power=after["P_in"].max(),
        peak_power_filtered=after["P_meas"].max(),
        peak_normal_force=after["F_N"].max(),
        caliper_energy=stored,
        disc_share=share,
        rate_limited=100.0 * float(held["sat_rate"].mean()),
        peak_speed=np.abs(after["omega_1"]).max(),
        energy_in=_gained(after, "W_supply"),
        energy_braked=_gained(after, "W_brake"),
        energy_left=np.abs(energy_residual(run)).max(),
    )


def _contact(held: xr.Dataset) -> float:
    """Return when the pads first press [s]; without clearance they touch from the start."""
    return 0.0 if parameters_of(held).caliper.clearance == 0.0 else first(held, "F_N", 0.0)


def parameters_of(run: xr.Dataset) -> WedgeParameters:
    """Return the parameters with which a recording was made."""
    known = getattr(run, "par", None)  # of plain rows
    if isinstance(known, WedgeParameters):
        return known
    return WedgeParameters.model_validate_json(run.attrs["parameters"])


def clearance(x: float, par: WedgeParameters) -> float:
    """Return the clearance of the pads [m] at a wedge travel [m], run-out left out."""
    return par.caliper.clearance - abs(x) * wedge.slope(par.wedge)


def release_time(run: xr.Dataset, begin: float, name: str = "release_time") -> Kpi:
    """Return the time from the end of the demand [s] until the pads leave the disc for good."""
    after = run.sel(time=slice(begin - 1e-9, None))
    pressing = np.flatnonzero(after["F_N"].values > 0)
    value, note = math.nan, ""
    if not after.sizes["time"]:
        note = "no row of the recording lies after the demand"
    elif not pressing.size:
        note = "the pads do not press when the demand falls"
    elif pressing[-1] + 1 == after.sizes["time"]:
        note = "the pads press until the end of the recording"
    else:
        value = float(after["time"].values[pressing[-1]]) - begin
    text = "Time from the end of the demand until the pads have left the disc."
    return Kpi(name, value, "s", text, note)


def parking_time(run: xr.Dataset, begin: float, name: str = "parking_time") -> Kpi:
    """Return the time from the end of the demand [s] until the brake is parked."""
    after = run.sel(time=slice(begin - 1e-9, None))
    parked = np.flatnonzero(after["mode"].values == PARKED)
    value, note = math.nan, "not parked until the end of the recording"
    if parked.size:
        value, note = float(after["time"].values[parked[0]]) - begin, ""
    return Kpi(name, value, "s", "Time from the end of the demand until the brake is parked.", note)


def first(run: xr.Dataset, name: str, level: float) -> float:
    """Return when a signal first exceeds a level [s], interpolated; NaN where it never does."""
    t, y = run["time"].values, run[name].values
    above = np.flatnonzero(y > level)
    if above.size == 0:
        return math.nan
    k = int(above[0])
    if k == 0 or level == 0.0:
        return float(t[k])
    return float(t[k - 1] + (level - y[k - 1]) / (y[k] - y[k - 1]) * (t[k] - t[k - 1]))


def mean(run: xr.Dataset, name: str, begin: float, end: float) -> float:
    """Return the mean of a signal between two times [s]; NaN where no row lies there."""
    values = run[name].sel(time=slice(begin - 1e-9, end + 1e-9)).values
    return float(values.mean()) if values.size else math.nan


def swing(run: xr.Dataset, name: str, begin: float, end: float) -> float:
    """Return the peak-to-peak value of a signal between two times [s]; NaN where no row is."""
    values = run[name].sel(time=slice(begin - 1e-9, end + 1e-9)).values
    return float(np.ptp(values)) if values.size else math.nan


def _gained(run: xr.Dataset, name: str) -> float:
    return float(run[name].values[-1] - run[name].values[0])
