"""Hard braking: a pressure demand step in closed loop (Dardanelli 2010, Fig. 7a)."""

from __future__ import annotations

from typing import Any

from bywire.bench.experiment import Case, Experiment
from bywire.bench.kpis import effort, occupation, step_response
from bywire.bench.kpis.families import FamilyJudge, units_of
from bywire.brakes.motorcycle.case import case_from_rest, smoothing, step_at_zero
from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Duration, Pressure, TimeConstant


class Options(ParameterSet):
    """The braking maneuver."""

    p_from: Pressure
    """pressure demand before the step"""
    p_to: Pressure
    """pressure demand after the step"""
    duration: Duration
    """recording time after the step"""
    settle: TimeConstant
    """time before the step for the dither and the loop to settle"""
    smoothing: TimeConstant
    """moving average for the step's KPIs; default: one dither period; 0: raw pressure"""


def cases(par: MotorcycleParameters, options: Options, _: object = None) -> tuple[Case, ...]:
    """Return the single run."""
    stimulus = step_at_zero("p_set", options.p_from, options.p_to)
    return (
        case_from_rest(
            "run",
            par,
            "pressure",
            options.p_from,
            stimulus,
            options.duration,
            settle=options.settle,
            keep=min(options.settle, 0.1),
        ),
    )


def step(options: Options) -> step_response.Setting:
    """Return the step of the pressure."""
    return step_response.Setting(
        "p_mc",
        0.0,
        options.p_from,
        options.p_to,
        smoothing=options.smoothing,
        set_point="p_ref",
    )


def judged(options: Options) -> dict[str, Any]:
    """Return the families of key figures: step of the pressure p_mc, effort, utilization."""
    return {
        "step_response": step(options),
        "effort": effort.Setting(),
        "occupation": occupation.Setting(),
    }


EXPERIMENT = Experiment(
    name="hard-braking",
    assembly="motorcycle-brake",
    summary="pressure step from {p_from} to {p_to} in closed loop, as in Fig. 7a of Dardanelli "
    "et al.",
    options=Options,
    defaults=Options(p_from=6e5, p_to=37e5, duration=1.2, settle=1.0, smoothing=0.02),
    cases=cases,
    judge=FamilyJudge(judged),
    kpis=units_of("step_response", "effort", "occupation", resolved={"level": "Pa"}),
    figures=("step-response", "time-traces", "energy-balance"),
    step=step,
    following=smoothing,
)
