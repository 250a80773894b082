"""End of braking: the demand falls to zero, or the power stages switch off under load.

Roberts et al. (2003) show the end of a pulse in Fig. 9. The release and its key figures are ours.
Without power, dry friction holds the brake.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

import numpy as np

from bywire.bench.experiment import Case, Experiment, Recordings
from bywire.bench.kpis.kpi import Figures, Kpi
from bywire.brakes.wedge.case import (
    along_disc,
    case_from_parked,
    parameters_of,
    parking_time,
    release_time,
    steps,
)
from bywire.brakes.wedge.elements import wedge
from bywire.brakes.wedge.laws.moment_control import SomeMoment
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Duration
from bywire.core.typing import Array

if TYPE_CHECKING:
    import xarray as xr


def _braked_case(
    par: WedgeParameters,
    stimulus: Callable[[Array], Mapping[str, Array]],
    settle: float,
    duration: float,
) -> Case:
    """Return a run that brakes for the settling time [s] and ends braking at time zero."""
    return case_from_parked(par, stimulus, duration, settle=settle, keep=min(settle, 0.1))


# --- Release: its speed, and the remaining clearance of the pads

_LOW = 0.05  # fraction of the moment at the release

FALL = Figures(
    moment_start=("N*m", "Moment when the demand falls."),
    time_to_5=("s", "Time until the moment stays below 5 % of its initial value."),
)
FREEDOM = Figures(
    drag_moment=("N*m", "Residual drag: maximum moment after parking."),
    travel_left=("m", "Distance of the wedge from the middle at the end."),
    clearance_regained=(
        "m",
        "Total clearance of both pads at the end, without runout. Negative if the pads are "
        "applied.",
    ),
    clearance_nominal=("m", "Total clearance with the wedge centered."),
    travel_beyond=("m", "Maximum wedge travel past the middle, toward the other side."),
    peak_current=("A", "Maximum motor current during the release."),
    energy_in=("J", "Energy at the drives' input until the brake is parked, including standby."),
)


class ReleaseOptions(ParameterSet):
    """The maneuver."""

    M_hold: SomeMoment
    """moment from which the brake is released"""
    settle: Duration
    """time of controlled braking before the release"""
    duration: Duration
    """recording time after the demand falls to zero"""


def release(par: WedgeParameters, options: ReleaseOptions, _: object = None) -> tuple[Case, ...]:
    """Return the single run, which brakes during the settling time and releases at time zero."""
    levels = {-options.settle: options.M_hold, 0.0: 0.0}
    return (
        _braked_case(par, lambda t: {"M_set": steps(t, levels)}, options.settle, options.duration),
    )


def judge_release(recordings: Recordings, options: ReleaseOptions) -> tuple[Kpi, ...]:
    """Return the moment's fall time, the residual drag, and the energy of the release."""
    run = along_disc(recordings["run"]).sel(time=slice(-1e-9, None))
    par = parameters_of(run)
    home = parking_time(run, 0.0)
    parked = run.sel(time=slice(home.value, None)) if math.isfinite(home.value) else None
    drag = math.nan if parked is None else float(np.abs(parked["M_B"]).max())
    end = float(run["x"].values[-1])
    until = run.sel(time=slice(None, home.value)) if parked is not None else run
    energy = float(until["W_supply"].values[-1] - until["W_supply"].values[0])
    not_parked = (
        "the brake is not parked, so the energy includes everything until the end of the recording"
    )
    counted = "" if parked is not None else not_parked
    return (
        *FALL(moment_start=run["M_B"].values[0], time_to_5=_fall(run)),
        release_time(run, 0.0),
        home,
        *FREEDOM(
            drag_moment=(drag, home.note),
            travel_left=abs(end),
            clearance_regained=_clearance(end, par),
            clearance_nominal=par.caliper.clearance,
            travel_beyond=max(0.0, -float(_toward(run).min())),
            peak_current=max(float(np.abs(run[name]).max()) for name in ("i_1", "i_2")),
            energy_in=(energy, counted),
        ),
    )


def _clearance(x: float, par: WedgeParameters) -> float:
    """Return the clearance of the pads [m] at a wedge travel [m], without runout."""
    return par.caliper.clearance - abs(x) * wedge.slope(par.wedge)


def _toward(run: xr.Dataset) -> xr.DataArray:
    """Return the wedge travel, positive on the side where the wedge is at the release."""
    return run["x"] * (-1.0 if float(run["x"].values[0]) < 0 else 1.0)


def _fall(run: xr.Dataset) -> tuple[float, str]:
    """Return the time until the moment stays below a twentieth of its initial value."""
    t, M = run["time"].values, np.abs(run["M_B"].values)
    level = _LOW * M[0]
    above = np.flatnonzero(level < M)
    if not above.size:
        return math.nan, "the moment at the release is zero"
    k = int(above[-1])
    if k + 1 == t.size:
        return math.nan, "the moment does not fall to 5 % within the recording"
    return float(t[k] + (t[k + 1] - t[k]) * (M[k] - level) / (M[k] - M[k + 1])), ""


MOMENT_RELEASE = Experiment(
    name="moment-release",
    assembly="wedge-brake",
    summary="release from {M_hold}: times, residual drag, regained clearance, energy",
    options=ReleaseOptions,
    defaults=ReleaseOptions(M_hold=500.0, settle=0.6, duration=0.4),
    cases=release,
    judge=judge_release,
    kpis=FALL.units | {"release_time": "s", "parking_time": "s"} | FREEDOM.units,
    figures=("time-traces", "energy-balance"),
)


# --- Power off: dry friction holds the brake

POWER_OFF_FIGURES = Figures(
    time_to_rest=("s", "Time from power-off until shafts and wedge stick permanently."),
    drift=("m", "Maximum change in wedge travel after that time."),
    relaxation=("m", "Change in wedge travel before that time."),
    moment_start=("N*m", "Moment at power-off."),
    moment_end=("N*m", "Moment at the end, including runout."),
    preload_end=("N", "Wedge preload at the end."),
    end_stop_force=("N", "Maximum force at an end stop."),
    undefined="the brake does not come to rest within the recording",
)


class PowerOffOptions(ParameterSet):
    """The maneuver."""

    M_hold: SomeMoment
    """moment at power-off"""
    settle: Duration
    """time of controlled braking before power-off"""
    duration: Duration
    """recording time without power"""


def power_off(par: WedgeParameters, options: PowerOffOptions, _: object = None) -> tuple[Case, ...]:
    """Return the single run, which brakes during the settling time and loses power at time zero."""
    levels, off = {-options.settle: options.M_hold}, {0.0: 1.0}
    return (
        _braked_case(
            par,
            lambda t: {"M_set": steps(t, levels), "power_off": steps(t, off)},
            options.settle,
            options.duration,
        ),
    )


def judge_power_off(recordings: Recordings, options: PowerOffOptions) -> tuple[Kpi, ...]:
    """Return the relaxation, the time to rest, and the creep afterward."""
    after = along_disc(recordings["run"]).sel(time=slice(-1e-9, None))
    t, x, stuck = (after[name].values for name in ("time", "x", "stuck"))
    moving = np.flatnonzero(stuck == 0)
    rest = 0 if moving.size == 0 else int(moving[-1]) + 1
    rests = rest < t.size
    squeeze = np.minimum(after["f_1"].values, after["f_2"].values)
    return POWER_OFF_FIGURES(
        time_to_rest=t[rest] if rests else math.nan,
        drift=np.abs(x[rest:] - x[rest]).max() if rests else math.nan,
        relaxation=x[rest] - x[0] if rests else math.nan,
        moment_start=after["M_B"].values[0],
        moment_end=after["M_B"].values[-1],
        preload_end=max(0.0, float(squeeze[-1])),
        end_stop_force=np.abs(after["F_end"].values).max(),
    )


POWER_OFF_HOLD = Experiment(
    name="power-off-hold",
    assembly="wedge-brake",
    summary="power-off at {M_hold}: moment that dry friction holds, and time to rest",
    options=PowerOffOptions,
    defaults=PowerOffOptions(M_hold=500.0, settle=0.6, duration=2.0),
    cases=power_off,
    judge=judge_power_off,
    kpis=POWER_OFF_FIGURES.units,
    figures=("time-traces", "energy-balance"),
)
