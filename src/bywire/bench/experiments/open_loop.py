"""Open loop: an ideal current or voltage source at the motor, with any stimulus."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from bywire.assemblies.motorcycle_parameters import MotorcycleParameters
from bywire.assemblies.motorcycle_trim import holding_current
from bywire.bench.experiment import Case, Experiment, Recordings
from bywire.bench.kpis import effort, occupation
from bywire.bench.kpis.kpi import Kpi
from bywire.bench.kpis.registry import evaluate, units_of
from bywire.bench.motorcycle_case import case_from_rest
from bywire.bench.stimuli.registry import Stimulus
from bywire.core.errors import ParameterError
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Duration, TimeConstant, Unit


class Options(ParameterSet):
    """The source."""

    source: Literal["current", "voltage"]
    """what the stimulus drives"""
    add_holding: bool
    """whether what holds p_start is added to the stimulus"""
    p_start: Annotated[float, Unit("Pa", 2e6), Field(ge=0, allow_inf_nan=False)]
    """pressure from whose equilibrium the run starts"""
    duration: Duration
    """length of the run"""
    record: Duration
    """recording interval"""
    settle: TimeConstant
    """time before zero, at the stimulus' first value"""


def cases(
    par: MotorcycleParameters, options: Options, stimulus: Stimulus | None
) -> tuple[Case, ...]:
    """Return the one run."""
    if stimulus is None:
        raise ParameterError(
            "open-loop needs a [stimulus] section: kind = step, ramp, sine, chirp, multisine or "
            "table, with its parameters"
        )
    current = options.source == "current"
    i = holding_current(options.p_start, par) if options.add_holding else 0.0
    offset = i if current else par.motor.R_m * i
    name = "i_set" if current else "v_set"
    return (
        case_from_rest(
            "run",
            par,
            "current-source" if current else "voltage-source",
            options.p_start,
            lambda t: {name: offset + stimulus.sample(t)},
            options.duration,
            settle=options.settle,
            record=options.record,
        ),
    )


def judge(recordings: Recordings, options: Options) -> tuple[Kpi, ...]:
    """Return effort and occupation."""
    run = recordings["run"]
    found = evaluate("effort", run, effort.Setting())
    found |= evaluate("occupation", run, occupation.Setting())
    peak = Kpi("p_max", float(run["p_mc"].max()), "Pa", "Largest master-cylinder pressure.")
    return (*found.values(), peak)


EXPERIMENT = Experiment(
    name="open-loop",
    assembly="motorcycle-brake",
    summary="ideal current or voltage source at the motor, any stimulus",
    options=Options,
    defaults=Options(
        source="current", add_holding=False, p_start=0.0, duration=1.0, record=1e-3, settle=0.0
    ),
    cases=cases,
    judge=judge,
    kpis={**units_of("effort", "occupation"), "p_max": "Pa"},
    figures=("time-traces", "energy-balance"),
    driven_unit=lambda options: "A" if options.source == "current" else "V",
)
