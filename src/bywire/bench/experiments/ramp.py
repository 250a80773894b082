"""Ramp: an input goes slowly up and down again, for the loop that friction and play open."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from bywire.bench.experiment import Case, Experiment, Recordings
from bywire.bench.generic_experiment import GenericExperiment, InputLevel, InputRate, Subject
from bywire.bench.kpis import extremes, hysteresis
from bywire.bench.kpis.kpi import Kpi
from bywire.bench.kpis.registry import evaluate, units_of
from bywire.bench.stimuli import ramp
from bywire.bench.stimuli.registry import Stimulus
from bywire.core.errors import ParameterError
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Duration, TimeConstant


class Options(ParameterSet):
    """The ramp, from time zero on."""

    input: str
    """stimulus of the model that is ramped; its only one unless given"""
    output: str
    """recorded signal that answers; the first one of the input's unit unless given"""
    drive: str
    """input or recorded signal that drives the loop, such as a current; the input unless given"""
    start: InputLevel
    """input at the beginning and at the end"""
    end: InputLevel
    """input at the turning point"""
    slope: InputRate
    """magnitude of the slope, there and back"""
    t_hold: TimeConstant
    """time spent at the turning point"""
    record: Duration
    """recording interval"""
    settle: TimeConstant
    """time before the ramp, at its first level"""
    smoothing: TimeConstant
    """moving average for the loop's key figures, 0 for the raw signals"""


def build(subject: Subject) -> Experiment:
    """Return the experiment of a model."""
    drive_unit = subject.units["drive"]
    units = {
        "drive": drive_unit,
        "drive*response": f"{drive_unit}*{subject.units['output']}",
        "level": subject.units["output"],
    }

    def cases(par: Any, options: Any, stimuli: Mapping[str, Stimulus]) -> tuple[Case, ...]:
        """Return the one run."""
        height = abs(options.end - options.start)
        if height == 0.0:
            raise ParameterError(
                f"options.start and options.end are both {options.end:g} {subject.units['input']}: "
                "that is no ramp"
            )
        shape = ramp.Parameters(
            start=options.start, end=options.end, slope=options.slope, t_start=0.0,
            t_hold=options.t_hold, after="return",
        )  # fmt: skip
        return (
            subject.case(
                par, lambda t: ramp.sample(t, shape), stimuli,
                duration=2.0 * height / options.slope + options.t_hold, settle=options.settle,
                record=options.record,
            ),
        )  # fmt: skip

    def loop(options: Any) -> hysteresis.Setting:
        """Return what the loop is of."""
        return hysteresis.Setting(
            subject.names["drive"], subject.output, options.smoothing, demand=subject.input
        )

    def judge(recordings: Recordings, options: Any) -> tuple[Kpi, ...]:
        """Return key figures of the loop, extremes of the output, effort and occupation."""
        run = recordings["run"]
        found = evaluate("hysteresis", run, loop(options))
        found |= evaluate("extremes", run, extremes.Setting(subject.output))
        return (*found.values(), *subject.judged(run))

    return Experiment(
        name=GENERIC.name,
        assembly=subject.model.name,
        summary=GENERIC.summary,
        options=subject.options,
        defaults=subject.defaults,
        cases=cases,
        judge=judge,
        kpis={**units_of("hysteresis", "extremes", resolved=units), **subject.totals()},
        figures=subject.figures("hysteresis-loop"),
        loop=loop,
        beside=subject.beside(),
    )


GENERIC = GenericExperiment(
    name="ramp",
    summary="slow ramp of any input up and down: the hysteresis loop of any output",
    options=Options,
    signals={"input": "stimulus", "output": "recording", "drive": "input or recording"},
    defaults={
        "start": 0.0, "end": 1.0, "slope": 0.1, "t_hold": 0.0, "record": 1e-3, "settle": 0.0,
        "smoothing": 0.0,
    },
    build=build,
)  # fmt: skip
