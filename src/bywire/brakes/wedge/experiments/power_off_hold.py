"""Power-off hold: the power stages go off under load, and dry friction holds the brake."""

from __future__ import annotations

import math

import numpy as np

from bywire.bench.experiment import Case, Experiment, Recordings
from bywire.bench.kpis.kpi import Figures, Kpi
from bywire.brakes.wedge.case import case_from_parked, steps
from bywire.brakes.wedge.laws.moment_control import SomeMoment
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.brakes.wedge.rows import along_disc
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Duration

FIGURES = Figures(
    time_to_rest=("s", "Time from power off until all stick for good."),
    drift=("m", "Largest change of the wedge's travel after that."),
    relaxation=("m", "Change of the wedge's travel until that."),
    moment_start=("N*m", "Moment at power off."),
    moment_end=("N*m", "Moment at the end; the run-out is in it."),
    preload_end=("N", "Preload of the wedge at the end."),
    end_stop_force=("N", "Largest force of an end stop."),
    undefined="the brake does not come to rest in the recorded time",
)


class Options(ParameterSet):
    """The maneuver."""

    M_hold: SomeMoment
    """moment at which the power goes off"""
    settle: Duration
    """time of controlled braking before"""
    duration: Duration
    """time recorded without power"""


def cases(par: WedgeParameters, options: Options, _: object = None) -> tuple[Case, ...]:
    """Return the one run: braking from the start of the settling time, power off at zero."""
    levels, off = {-options.settle: options.M_hold}, {0.0: 1.0}
    return (
        case_from_parked(
            par,
            lambda t: {"M_set": steps(t, levels), "power_off": steps(t, off)},
            options.duration,
            settle=options.settle,
            keep=min(options.settle, 0.1),
        ),
    )


def judge(recordings: Recordings, options: Options) -> tuple[Kpi, ...]:
    """Return how far the brake relaxes, when it rests, and whether it creeps afterwards."""
    after = along_disc(recordings["run"]).sel(time=slice(-1e-9, None))
    t, x, stuck = (after[name].values for name in ("time", "x", "stuck"))
    moving = np.flatnonzero(stuck == 0)
    rest = 0 if moving.size == 0 else int(moving[-1]) + 1
    rests = rest < t.size
    squeeze = np.minimum(after["f_1"].values, after["f_2"].values)
    return FIGURES(
        time_to_rest=t[rest] if rests else math.nan,
        drift=np.abs(x[rest:] - x[rest]).max() if rests else math.nan,
        relaxation=x[rest] - x[0] if rests else math.nan,
        moment_start=after["M_B"].values[0],
        moment_end=after["M_B"].values[-1],
        preload_end=max(0.0, float(squeeze[-1])),
        end_stop_force=np.abs(after["F_end"].values).max(),
    )


EXPERIMENT = Experiment(
    name="power-off-hold",
    assembly="wedge-brake",
    summary="power off at {M_hold}: what dry friction holds, for how long",
    options=Options,
    defaults=Options(M_hold=500.0, settle=0.6, duration=2.0),
    cases=cases,
    judge=judge,
    kpis=FIGURES.units,
    figures=("time-traces", "energy-balance"),
)
