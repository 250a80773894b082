"""Apply and release: ramp up, hold, ramp down, park."""

from __future__ import annotations

import numpy as np

from bywire.authoring import (
    Case,
    Duration,
    Experiment,
    Kpi,
    ParameterSet,
    Recordings,
    Stimulus,
    effort,
    evaluate,
    occupation,
    units_of,
)
from emb_caliper.case import Array, case_from_rest
from emb_caliper.experiments.slow_strokes import TopForce
from emb_caliper.parameters import BrakeParameters


class Options(ParameterSet):
    """The maneuver."""

    F_top: TopForce
    """clamp force during the hold"""
    t_ramp: Duration
    """rise time of the demand, and also its fall time"""
    t_hold: Duration
    """length of the hold"""
    duration: Duration
    """recording time"""


def demand(t: Array, options: Options) -> Array:
    """Return the force demand [N] at times [s]."""
    o = options
    corners = np.cumsum((0.0, o.t_ramp, o.t_hold, o.t_ramp))
    return np.interp(t, corners, (0.0, o.F_top, o.F_top, 0.0))


def cases(par: BrakeParameters, options: Options, _: Stimulus | None = None) -> tuple[Case, ...]:
    """Return the single run, which starts from the parked piston."""
    return (
        case_from_rest(
            par, "force", 0.0, lambda t: {"F_set": demand(t, options)}, options.duration
        ),
    )


def judge(recordings: Recordings, options: Options) -> tuple[Kpi, ...]:
    """Return tracking errors, holding current, and the time until the disc is free."""
    run = recordings["run"]
    t, F = run["time"].values, run["F_cl"].values
    error = run["F_ref"].values - F
    begin = options.t_ramp + 0.5 * options.t_hold
    holding = (t >= begin) & (t <= options.t_ramp + options.t_hold)
    release = 2.0 * options.t_ramp + options.t_hold
    pressed = np.flatnonzero(F > 0.0)
    last = float(t[pressed[-1]]) if pressed.size else 0.0
    free = last < float(t[-1])
    note = "" if free else "the pads touch the disc until the end of the recording"
    figures = evaluate("effort", run, effort.Setting())
    figures |= evaluate("occupation", run, occupation.Setting())
    return (
        Kpi("error_max", float(np.max(np.abs(error))), "N", "Maximum clamp force error."),
        Kpi(
            "error_held",
            float(np.mean(error[holding])),
            "N",
            "Mean clamp force error in the second half of the hold.",
        ),
        Kpi(
            "current_held",
            float(np.mean(run["i"].values[holding])),
            "A",
            "Mean current in the second half of the hold.",
        ),
        Kpi(
            "time_to_free",
            last - release if free else float("nan"),
            "s",
            "Time from the end of the demand until the pads leave the disc.",
            note,
        ),
        *figures.values(),
    )


EXPERIMENT = Experiment(
    name="apply-release",
    assembly="emb-caliper",
    variants=("emb-caliper-pmsm",),
    summary="ramp to {F_top:kN}, hold, ramp down, park: tracking, holding current, release",
    options=Options,
    defaults=Options(F_top=25e3, t_ramp=0.5, t_hold=0.5, duration=2.0),
    cases=cases,
    judge=judge,
    kpis={
        "error_max": "N",
        "error_held": "N",
        "current_held": "A",
        "time_to_free": "s",
        **units_of("effort", "occupation"),
    },
    figures=("time-traces", "energy-balance"),
)
