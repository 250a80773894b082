"""Approach: the step of the linear benchmark over the clearance."""

from __future__ import annotations

from bywire.authoring import (
    Case,
    Duration,
    Experiment,
    Kpi,
    Length,
    ParameterSet,
    Recordings,
    Stimulus,
    evaluate,
    step_response,
    units_of,
)
from emb_caliper.case import step_at_zero
from emb_caliper.rigs.approach import Approach, ApproachParameters, at_rest


class Options(ParameterSet):
    """The step."""

    x_to: Length
    """travel demand"""
    duration: Duration
    """recording time"""


def cases(par: ApproachParameters, options: Options, _: Stimulus | None = None) -> tuple[Case, ...]:
    """Return the single run, which starts from rest."""
    state, memory = at_rest()
    stimulus = step_at_zero("x_set", 0.0, options.x_to)
    run = Case(
        "run",
        Approach(),
        par,
        state,
        memory,
        stimulus,
        options.duration,
        start=lambda _: (state, memory),
        record=1e-4,
    )
    return (run,)


def step(options: Options) -> step_response.Setting:
    """Return the travel step."""
    return step_response.Setting("x", 0.0, 0.0, options.x_to, set_point="x_set")


def judge(recordings: Recordings, options: Options) -> tuple[Kpi, ...]:
    """Return the step's key figures and the maximum travel."""
    run = recordings["run"]
    figures = evaluate("step_response", run, step(options))
    farthest = Kpi("x_max", float(run["x"].max()), "m", "Maximum travel.")
    return (*figures.values(), farthest)


EXPERIMENT = Experiment(
    name="approach",
    assembly="emb-approach",
    summary="linear benchmark of 2015: step over a clearance of {x_to} without contact",
    options=Options,
    defaults=Options(x_to=5e-3, duration=0.1),
    cases=cases,
    judge=judge,
    kpis={**units_of("step_response", resolved={"level": "m"}), "x_max": "m"},
    figures=("time-traces",),
    step=step,
)
