"""Pressure step: the braking system's answer to a current step (Dardanelli 2010, Fig. 6)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal, cast

import numpy as np
import xarray as xr

from bywire.bench.experiment import Case, Experiment
from bywire.bench.kpis import effort, occupation, step_response
from bywire.bench.kpis.cases import FamilyJudge
from bywire.bench.kpis.kpi import Figures, Kpi, KpiOfCases
from bywire.bench.kpis.registry import units_of
from bywire.bench.rows import Rows
from bywire.brakes.motorcycle.case import case_from_rest, smoothing, step_at_zero
from bywire.brakes.motorcycle.operating_point import settled_start
from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.brakes.motorcycle.trim import holding_current
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Current, Duration, Pressure, TimeConstant

GAIN = Figures(
    static_gain=("Pa/A", "Change of the mean pressure per change of the current demand."),
)


class Options(ParameterSet):
    """The step of the current demand."""

    p_start: Pressure
    """pressure before the step"""
    start: Literal["settled", "frictionless"]
    """whether the pressure under dither settles at p_start, or the equilibrium without friction"""
    i_step: Current
    """height of the step of the current demand"""
    duration: Duration
    """time recorded after the step"""
    settle: TimeConstant
    """time before the step in which the dithered pressure settles"""
    smoothing: TimeConstant
    """moving average for the step's KPIs; one dither period unless given, 0 for the raw pressure"""


def cases(par: MotorcycleParameters, options: Options, _: object = None) -> tuple[Case, ...]:
    """Return the one run, open pressure loop, closed current loop."""
    p = options.p_start
    if options.start == "settled" and options.settle > 0:
        p = settled_start(p, par, options.settle)
    return _from(p, par, options)


def preview(par: MotorcycleParameters, options: Options, _: object = None) -> tuple[Case, ...]:
    """Return the run as if the pressure settled at the equilibrium without friction."""
    return _from(options.p_start, par, options)


def _from(p: float, par: MotorcycleParameters, options: Options) -> tuple[Case, ...]:
    i = holding_current(p, par)
    stimulus = step_at_zero("i_set", i, i + options.i_step)
    return (
        case_from_rest(
            "run", par, "current", p, stimulus, options.duration,
            settle=options.settle, keep=min(options.settle, 0.5),
        ),
    )  # fmt: skip


def step(options: Options) -> step_response.Setting:
    """Return the step of the pressure; its levels are those of the response."""
    return step_response.Setting("p_mc", 0.0, smoothing=options.smoothing)


def settings(options: Options) -> dict[str, Any]:
    """Return what the step is judged by."""
    return {
        "step_response": step(options),
        "effort": effort.Setting(),
        "occupation": occupation.Setting(),
    }


def gain(run: xr.Dataset, options: Options) -> tuple[Kpi, ...]:
    """Return the static gain."""
    data = step_response.select(run, step(options))
    return GAIN(static_gain=((data.end - data.start) / options.i_step, data.note))


def gains(rows: Rows, options: Sequence[Options]) -> tuple[KpiOfCases, ...] | None:
    """Return the static gains of many cases; None where their steps are not looked at alike."""
    alike = step(options[0])
    if any(step(each) != alike for each in {id(each): each for each in options}.values()):
        return None
    data = step_response.select(cast(xr.Dataset, rows), alike)
    if data.problem:
        return None
    values = (data.end - data.start) / np.array([each.i_step for each in options])
    unit, definition = GAIN.declared["static_gain"]
    return (KpiOfCases("static_gain", values, unit, definition, lambda _: data.note),)


EXPERIMENT = Experiment(
    name="pressure-step",
    assembly="motorcycle-brake",
    summary="current step of 0.35 A at 25 bar from equilibrium, dither on (Fig. 6)",
    options=Options,
    defaults=Options(
        p_start=25e5, start="settled", i_step=0.35, duration=4.0, settle=3.0, smoothing=0.02
    ),
    cases=cases,
    judge=FamilyJudge(
        settings, further=gain, further_together=gains, further_signals=("p_mc",)
    ),
    kpis={
        **units_of("step_response", "effort", "occupation", resolved={"level": "Pa"}),
        **GAIN.units,
    },
    figures=("step-response", "time-traces"),
    step=step,
    following=smoothing,
    preview=preview,
    begins_at={"p_start": "p_mc"},
)
