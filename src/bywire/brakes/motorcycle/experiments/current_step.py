"""Current step in the current loop alone (Dardanelli 2010, Fig. 3)."""

from __future__ import annotations

from typing import Any

from bywire.bench.experiment import Case, Experiment
from bywire.bench.kpis import effort, step_response
from bywire.bench.kpis.families import FamilyJudge, units_of
from bywire.brakes.motorcycle.case import case_from_rest, step_at_zero
from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Current, Duration


class Options(ParameterSet):
    """The step."""

    i_step: Current
    """current demand after the step"""
    duration: Duration
    """recording time after the step"""
    record: Duration
    """recording interval, finer than the ECU's sample time"""


def cases(par: MotorcycleParameters, options: Options, _: object = None) -> tuple[Case, ...]:
    """Return the single run, which starts with a retracted piston, without dither and filter."""
    stimulus = step_at_zero("i_set", 0.0, options.i_step)
    return (
        case_from_rest(
            "run",
            par,
            "current-direct",
            0.0,
            stimulus,
            options.duration,
            settle=5e-3,
            keep=5e-3,
            record=options.record,
        ),
    )


def step(options: Options) -> step_response.Setting:
    """Return the step of the motor current."""
    return step_response.Setting("i", 0.0, 0.0, options.i_step, set_point="i_ref")


def judged(options: Options) -> dict[str, Any]:
    """Return the families of key figures: step of the motor current, and effort."""
    return {"step_response": step(options), "effort": effort.Setting()}


EXPERIMENT = Experiment(
    name="current-step",
    assembly="motorcycle-brake",
    summary="step of {i_step} in the closed current loop (Fig. 3 of Dardanelli et al.)",
    options=Options,
    defaults=Options(i_step=0.73, duration=0.04, record=1e-4),
    cases=cases,
    judge=FamilyJudge(judged),
    kpis=units_of("step_response", "effort", resolved={"level": "A"}),
    figures=("step-response", "time-traces"),
    step=step,
)
