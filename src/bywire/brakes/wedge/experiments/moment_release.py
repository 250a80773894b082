"""Moment release: the demand falls to zero; how fast the brake lets go, and how freely it stands.

Roberts et al. (2003) show the end of a pulse in Fig. 9; the maneuver and its figures are ours.
"""

from __future__ import annotations

import math

import numpy as np
import xarray as xr

from bywire.bench.experiment import Case, Experiment, Recordings
from bywire.bench.kpis.kpi import Kpi
from bywire.bench.stimuli.registry import Stimulus
from bywire.brakes.wedge.case import (
    case_from_parked,
    clearance,
    parameters_of,
    parking_time,
    release_time,
    steps,
)
from bywire.brakes.wedge.laws.moment_control import SomeMoment
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.brakes.wedge.rows import along_disc
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Duration

_LOW = 0.05  # of the moment at the release


class Options(ParameterSet):
    """The maneuver."""

    M_hold: SomeMoment
    """moment from which the brake is released"""
    settle: Duration
    """time of controlled braking before"""
    duration: Duration
    """time recorded after the demand fell to zero"""


def cases(par: WedgeParameters, options: Options, _: Stimulus | None = None) -> tuple[Case, ...]:
    """Return the one run: braking from the start of the settling time, no demand from zero on."""
    levels = {-options.settle: options.M_hold, 0.0: 0.0}
    return (
        case_from_parked(
            par, lambda t: {"M_set": steps(t, levels)}, options.duration,
            settle=options.settle, keep=min(options.settle, 0.1),
        ),
    )  # fmt: skip


def judge(recordings: Recordings, options: Options) -> tuple[Kpi, ...]:
    """Return how fast the moment falls, what drags afterwards, and what the release costs."""
    run = along_disc(recordings["run"]).sel(time=slice(-1e-9, None))
    par = parameters_of(run)
    home = parking_time(run, 0.0)
    parked = run.sel(time=slice(home.value, None)) if math.isfinite(home.value) else None
    drag = math.nan if parked is None else float(np.abs(parked["M_B"]).max())
    end = float(run["x"].values[-1])
    until = run.sel(time=slice(None, home.value)) if parked is not None else run
    energy = float(until["W_supply"].values[-1] - until["W_supply"].values[0])
    current = max(float(np.abs(run[name]).max()) for name in ("i_1", "i_2"))
    return (
        Kpi("moment_start", float(run["M_B"].values[0]), "N*m", "Moment when the demand falls."),
        _fall(run),
        release_time(run, 0.0),
        home,
        Kpi("drag_moment", drag, "N*m", "Largest moment from parking on: residual drag.",
            home.note),
        Kpi("travel_left", abs(end), "m", "Distance of the wedge from its middle at the end."),
        Kpi("clearance_regained", clearance(end, par), "m",
            "Clearance at the end, both pads together, no run-out; negative where they press."),
        Kpi("clearance_nominal", par.caliper.clearance, "m", "The same with the wedge centered."),
        Kpi("travel_beyond", max(0.0, -float(_toward(run).min())), "m",
            "Largest travel of the wedge past its middle, toward the other side."),
        Kpi("peak_current", current, "A", "Largest current of a motor during the release."),
        Kpi("energy_in", energy, "J",
            "Energy at the drives' input until the brake is parked, standby included.",
            "" if parked is not None else "not parked: counted until the end of the recording"),
    )  # fmt: skip


def _toward(run: xr.Dataset) -> xr.DataArray:
    """Return the wedge's travel, positive on the side on which it stood at the release."""
    return run["x"] * (-1.0 if float(run["x"].values[0]) < 0 else 1.0)


def _fall(run: xr.Dataset) -> Kpi:
    """Return the time until the moment has fallen to a twentieth for good."""
    t, M = run["time"].values, np.abs(run["M_B"].values)
    level = _LOW * M[0]
    above = np.flatnonzero(level < M)
    value, note = math.nan, ""
    if not above.size:
        note = "there is no moment at the release"
    elif above[-1] + 1 == t.size:
        note = "the moment does not fall that far in time"
    else:
        k = int(above[-1])
        value = float(t[k] + (t[k + 1] - t[k]) * (M[k] - level) / (M[k] - M[k + 1]))
    return Kpi("time_to_5", value, "s",
               "Time until the moment has fallen to 5 % of its start for good.", note)  # fmt: skip


EXPERIMENT = Experiment(
    name="moment-release",
    assembly="wedge-brake",
    summary="release from 500 N m: times, residual drag, clearance regained, energy",
    options=Options,
    defaults=Options(M_hold=500.0, settle=0.6, duration=0.4),
    cases=cases,
    judge=judge,
    kpis={
        "moment_start": "N*m",
        "time_to_5": "s",
        "release_time": "s",
        "parking_time": "s",
        "drag_moment": "N*m",
        "travel_left": "m",
        "clearance_regained": "m",
        "clearance_nominal": "m",
        "travel_beyond": "m",
        "peak_current": "A",
        "energy_in": "J",
    },
    figures=("time-traces", "energy-balance"),
)
