"""Open loop: any course of any input."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from bywire.bench.experiment import Case, Experiment, Recordings
from bywire.bench.generic_experiment import GenericExperiment, Subject
from bywire.bench.kpis import extremes
from bywire.bench.kpis.kpi import Kpi
from bywire.bench.kpis.registry import evaluate, units_of
from bywire.bench.stimuli.registry import Stimulus, wanted
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Duration, TimeConstant


class Options(ParameterSet):
    """What is driven, and what is looked at."""

    input: str
    """stimulus of the model that [stimulus] drives; its only one unless given"""
    output: str
    """recorded signal that is judged; the first one of the input's unit unless given"""
    duration: Duration
    """length of the run"""
    record: Duration
    """recording interval"""
    settle: TimeConstant
    """time before zero, at the stimulus' first value"""


def build(subject: Subject) -> Experiment:
    """Return the experiment of a model."""

    def cases(par: Any, options: Any, stimuli: Mapping[str, Stimulus]) -> tuple[Case, ...]:
        """Return the one run."""
        course = wanted(stimuli.get(""), "open-loop")
        return (
            subject.case(
                par, course.sample, stimuli, duration=options.duration, settle=options.settle,
                record=options.record,
            ),
        )  # fmt: skip

    def judge(recordings: Recordings, options: Any) -> tuple[Kpi, ...]:
        """Return extremes of the output, effort and occupation."""
        run = recordings["run"]
        found = evaluate("extremes", run, extremes.Setting(subject.output))
        return (*found.values(), *subject.judged(run))

    return Experiment(
        name=GENERIC.name,
        assembly=subject.model.name,
        summary=GENERIC.summary,
        options=subject.options,
        defaults=subject.defaults,
        cases=cases,
        judge=judge,
        kpis={
            **units_of("extremes", resolved={"level": subject.units["output"]}),
            **subject.totals(),
        },
        figures=subject.figures(),
        driven_unit=lambda _: subject.units["input"],
        beside=subject.beside(),
    )


GENERIC = GenericExperiment(
    name="open-loop",
    summary="any stimulus at any input",
    options=Options,
    signals={"input": "stimulus", "output": "recording"},
    defaults={"duration": 1.0, "record": 1e-3, "settle": 0.0},
    build=build,
)
