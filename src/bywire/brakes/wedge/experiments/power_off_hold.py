"""Power-off hold: the power stages go off under load, and dry friction holds the brake."""

from __future__ import annotations

import math

import numpy as np

from bywire.bench.experiment import Case, Experiment, Recordings
from bywire.bench.kpis.kpi import Kpi
from bywire.bench.stimuli.registry import Stimulus
from bywire.brakes.wedge.case import case_from_parked, steps
from bywire.brakes.wedge.laws.moment_control import SomeMoment
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.brakes.wedge.rows import along_disc
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Duration


class Options(ParameterSet):
    """The maneuver."""

    M_hold: SomeMoment
    """moment at which the power goes off"""
    settle: Duration
    """time of controlled braking before"""
    duration: Duration
    """time recorded without power"""


def cases(par: WedgeParameters, options: Options, _: Stimulus | None = None) -> tuple[Case, ...]:
    """Return the one run: braking from the start of the settling time, power off at zero."""
    levels, off = {-options.settle: options.M_hold}, {0.0: 1.0}
    return (
        case_from_parked(
            par, lambda t: {"M_set": steps(t, levels), "power_off": steps(t, off)},
            options.duration, settle=options.settle, keep=min(options.settle, 0.1),
        ),
    )  # fmt: skip


def judge(recordings: Recordings, options: Options) -> tuple[Kpi, ...]:
    """Return how far the brake relaxes, when it rests, and whether it creeps afterwards."""
    after = along_disc(recordings["run"]).sel(time=slice(-1e-9, None))
    t, x, stuck = (after[name].values for name in ("time", "x", "stuck"))
    moving = np.flatnonzero(stuck == 0)
    rest = 0 if moving.size == 0 else int(moving[-1]) + 1
    rests = rest < t.size
    note = "" if rests else "the brake does not come to rest in the recorded time"
    t_rest = float(t[rest]) if rests else math.nan
    drift = float(np.abs(x[rest:] - x[rest]).max()) if rests else math.nan
    relaxed = float(x[rest] - x[0]) if rests else math.nan
    squeeze = np.minimum(after["f_1"].values, after["f_2"].values)
    F_end = np.abs(after["F_end"].values)
    return (
        Kpi("time_to_rest", t_rest, "s", "Time from power off until all stick for good.", note),
        Kpi("drift", drift, "m", "Largest change of the wedge's travel after that.", note),
        Kpi("relaxation", relaxed, "m", "Change of the wedge's travel until that.", note),
        Kpi("moment_start", float(after["M_B"].values[0]), "N*m", "Moment at power off."),
        Kpi("moment_end", float(after["M_B"].values[-1]), "N*m",
            "Moment at the end; the run-out is in it."),
        Kpi("preload_end", max(0.0, float(squeeze[-1])), "N", "Preload of the wedge at the end."),
        Kpi("end_stop_force", float(F_end.max()), "N", "Largest force of an end stop."),
    )  # fmt: skip


EXPERIMENT = Experiment(
    name="power-off-hold",
    assembly="wedge-brake",
    summary="power off at 500 N m: what dry friction holds, for how long",
    options=Options,
    defaults=Options(M_hold=500.0, settle=0.6, duration=2.0),
    cases=cases,
    judge=judge,
    kpis={
        "time_to_rest": "s",
        "drift": "m",
        "relaxation": "m",
        "moment_start": "N*m",
        "moment_end": "N*m",
        "preload_end": "N",
        "end_stop_force": "N",
    },
    figures=("time-traces", "energy-balance"),
)
