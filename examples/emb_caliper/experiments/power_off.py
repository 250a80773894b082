"""Power off: the motor current ends under load, and friction determines the residual force."""

from __future__ import annotations

from typing import Literal

import numpy as np

from bywire.authoring import Case, Duration, Experiment, Kpi, ParameterSet, Recordings, Stimulus
from emb_caliper.case import case_from_rest, step_at_zero
from emb_caliper.ecu import travel_per_angle
from emb_caliper.experiments.slow_strokes import TopForce
from emb_caliper.parameters import BrakeParameters, DriveMode
from emb_caliper.trim import memory_at


class Options(ParameterSet):
    """Clamp force and type of power loss."""

    F_from: TopForce
    """clamp force before the power loss"""
    circuit: Literal["open", "short"]
    """open circuit without current, or short-circuited winding"""
    duration: Duration
    """recording time after the current ends"""


def held_force(par: BrakeParameters) -> float:
    """Return the maximum clamp force [N] that friction holds without current, inf for any force.

    If the load torque increases faster than the friction, (N - G) F = T_s.
    """
    grows = travel_per_angle(par) - par.friction.G
    return par.friction.T_s / grows if grows > 0.0 else float("inf")


def cases(par: BrakeParameters, options: Options, _: Stimulus | None = None) -> tuple[Case, ...]:
    """Return the single run. The current loop models the open circuit."""
    drive: DriveMode
    held, F = memory_at(options.F_from, par), options.F_from
    if options.circuit == "open":
        drive, stimulus = "current", step_at_zero("i_set", held.i_ref, 0.0)
    else:
        drive, stimulus = "voltage", step_at_zero("v_set", held.v_source, 0.0)
    return (case_from_rest(par, drive, F, stimulus, options.duration, settle=0.01, keep=0.01),)


def judge(recordings: Recordings, options: Options) -> tuple[Kpi, ...]:
    """Return the residual force, and the time until the shaft is at rest."""
    run = recordings["run"].sel(time=slice(-1e-9, None))
    time, stuck = run["time"].values, run["stuck"].values > 0.5
    rests = bool(stuck[-1])
    moving = np.flatnonzero(~stuck)
    t_rest = float(time[moving[-1] + 1] if moving.size else 0.0) if rests else float("nan")
    note = "" if rests else "the shaft does not come to rest within the recording"
    return (
        Kpi("residual_force", float(run["F_cl"].values[-1]), "N", "Clamp force at the end."),
        Kpi("time_to_rest", t_rest, "s", "Time until the shaft stays at rest.", note),
    )


EXPERIMENT = Experiment(
    name="power-off",
    assembly="emb-caliper",
    variants=("emb-caliper-pmsm",),
    summary="power loss at {F_from:kN}: clamp force that friction holds without current",
    options=Options,
    defaults=Options(F_from=25e3, circuit="open", duration=1.0),
    cases=cases,
    judge=judge,
    kpis={"residual_force": "N", "time_to_rest": "s"},
    figures=("time-traces", "energy-balance"),
)
