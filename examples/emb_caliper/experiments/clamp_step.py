"""Clamp step: a step of the force demand from the parked piston or from a clamp force."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from bywire.authoring import (
    Case,
    Duration,
    Experiment,
    Kpi,
    ParameterSet,
    Recordings,
    Stimulus,
    TimeConstant,
    Unit,
    effort,
    evaluate,
    occupation,
    step_response,
    units_of,
)
from emb_caliper.case import case_from_rest, step_at_zero
from emb_caliper.parameters import BrakeParameters

ClampForce = Annotated[float, Unit("N", 1e4), Field(ge=0, allow_inf_nan=False)]


class Options(ParameterSet):
    """The step."""

    F_from: ClampForce
    """clamp force before the step; 0 for the parked piston"""
    F_to: ClampForce
    """clamp force after the step"""
    duration: Duration
    """recording time after the step"""
    settle: TimeConstant
    """time before the step, in which loop and converter settle"""


def cases(par: BrakeParameters, options: Options, _: Stimulus | None = None) -> tuple[Case, ...]:
    """Return the single run."""
    stimulus = step_at_zero("F_set", options.F_from, options.F_to)
    return (
        case_from_rest(
            par,
            "force",
            options.F_from,
            stimulus,
            options.duration,
            settle=options.settle,
            keep=min(options.settle, 0.05),
        ),
    )


def step(options: Options) -> step_response.Setting:
    """Return the step of the clamp force."""
    return step_response.Setting("F_cl", 0.0, options.F_from, options.F_to, set_point="F_ref")


def judge(recordings: Recordings, options: Options) -> tuple[Kpi, ...]:
    """Return the key figures of step and effort, and the maximum motor speed."""
    run = recordings["run"]
    figures = evaluate("step_response", run, step(options))
    figures |= evaluate("effort", run, effort.Setting())
    figures |= evaluate("occupation", run, occupation.Setting())
    fastest = Kpi("speed_max", float(abs(run["omega"]).max()), "rad/s", "Maximum motor speed.")
    return (*figures.values(), fastest)


EXPERIMENT = Experiment(
    name="clamp-step",
    assembly="emb-caliper",
    variants=("emb-caliper-pmsm",),
    summary="step of the force demand, from the parked piston to {F_to:kN}",
    options=Options,
    defaults=Options(F_from=0.0, F_to=25e3, duration=0.8, settle=0.02),
    cases=cases,
    judge=judge,
    kpis={
        **units_of("step_response", "effort", "occupation", resolved={"level": "N"}),
        "speed_max": "rad/s",
    },
    figures=("step-response", "time-traces", "energy-balance"),
    step=step,
)
