"""Pressure step: the braking system's response to a current step (Dardanelli 2010, Fig. 6)."""

from __future__ import annotations

from typing import Any, Literal

from bywire.bench.experiment import Case, Experiment
from bywire.bench.kpis import effort, occupation, static_gain, step_response
from bywire.bench.kpis.families import FamilyJudge, units_of
from bywire.brakes.motorcycle.case import case_from_rest, settled_start, smoothing, step_at_zero
from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.brakes.motorcycle.trim import holding_current
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Current, Duration, Pressure, TimeConstant


class Options(ParameterSet):
    """The current demand step."""

    p_start: Pressure
    """pressure before the step"""
    start: Literal["settled", "frictionless"]
    """meaning of p_start: settled pressure with dither, or frictionless equilibrium"""
    i_step: Current
    """height of the current demand step"""
    duration: Duration
    """recording time after the step"""
    settle: TimeConstant
    """time before the step for the dithered pressure to settle"""
    smoothing: TimeConstant
    """moving average for the step's KPIs; default: one dither period; 0: raw pressure"""


def cases(par: MotorcycleParameters, options: Options, _: object = None) -> tuple[Case, ...]:
    """Return the single run: open pressure loop, closed current loop."""
    p = options.p_start
    if options.start == "settled" and options.settle > 0:
        p = settled_start(p, par, options.settle)
    return _from(p, par, options)


def preview(par: MotorcycleParameters, options: Options, _: object = None) -> tuple[Case, ...]:
    """Return the run as if the pressure settled at the frictionless equilibrium."""
    return _from(options.p_start, par, options)


def _from(p: float, par: MotorcycleParameters, options: Options) -> tuple[Case, ...]:
    i = holding_current(p, par)
    stimulus = step_at_zero("i_set", i, i + options.i_step)
    return (
        case_from_rest(
            "run",
            par,
            "current",
            p,
            stimulus,
            options.duration,
            settle=options.settle,
            keep=min(options.settle, 0.5),
        ),
    )


def step(options: Options) -> step_response.Setting:
    """Return the pressure step, with its levels from the response."""
    return step_response.Setting("p_mc", 0.0, smoothing=options.smoothing)


def settings(options: Options) -> dict[str, Any]:
    """Return the step's families of key figures."""
    return {
        "static_gain": static_gain.Setting(
            "p_mc", 0.0, options.i_step, "A", smoothing=options.smoothing
        ),
        "step_response": step(options),
        "effort": effort.Setting(),
        "occupation": occupation.Setting(),
    }


EXPERIMENT = Experiment(
    name="pressure-step",
    assembly="motorcycle-brake",
    summary="current step of {i_step} from equilibrium at {p_start}, as in Fig. 6 of Dardanelli "
    "et al.",
    options=Options,
    defaults=Options(
        p_start=25e5, start="settled", i_step=0.35, duration=4.0, settle=3.0, smoothing=0.02
    ),
    cases=cases,
    judge=FamilyJudge(settings),
    kpis=units_of(
        "step_response",
        "effort",
        "occupation",
        "static_gain",
        resolved={"level": "Pa", "gain": "Pa/A"},
    ),
    figures=("step-response", "time-traces"),
    step=step,
    following=smoothing,
    preview=preview,
    begins_at={"p_start": "p_mc"},
)
