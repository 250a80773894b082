"""Release: an input falls from one level to another, and the output with it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from bywire.bench.experiment import Case, Experiment, Recordings
from bywire.bench.generic_experiment import GenericExperiment, InputLevel, OutputLevel, Subject
from bywire.bench.kpis import release
from bywire.bench.kpis.kpi import Kpi
from bywire.bench.kpis.registry import evaluate, units_of
from bywire.bench.stimuli.registry import Stimulus
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Duration, TimeConstant


class Options(ParameterSet):
    """The release, from time zero on."""

    input: str
    """stimulus of the model that falls; its only one unless given"""
    output: str
    """recorded signal that is released; the first one of the input's unit unless given"""
    start: InputLevel
    """input before the release"""
    end: InputLevel
    """input after it"""
    t_ramp: TimeConstant
    """time in which the input falls, 0 for at once"""
    empty: OutputLevel
    """output below which it counts as released"""
    duration: Duration
    """time recorded after the release begins"""
    record: Duration
    """recording interval"""
    settle: TimeConstant
    """time before the release in which the output builds up"""


def build(subject: Subject) -> Experiment:
    """Return the experiment of a model."""

    def cases(par: Any, options: Any, stimuli: Mapping[str, Stimulus]) -> tuple[Case, ...]:
        """Return the one run."""
        ramp = max(options.t_ramp, 1e-9)
        fall = options.end - options.start
        return (
            subject.case(
                par, lambda t: options.start + fall * np.clip(t / ramp, 0.0, 1.0), stimuli,
                duration=options.duration, settle=options.settle, record=options.record,
            ),
        )  # fmt: skip

    def judge(recordings: Recordings, options: Any) -> tuple[Kpi, ...]:
        """Return time to empty and what is left, effort and occupation."""
        run = recordings["run"]
        setting = release.Setting(subject.output, options.empty)
        return (*evaluate("release", run, setting).values(), *subject.judged(run))

    return Experiment(
        name=GENERIC.name,
        assembly=subject.model.name,
        summary=GENERIC.summary,
        options=subject.options,
        defaults=subject.defaults,
        cases=cases,
        judge=judge,
        kpis={
            **units_of("release", resolved={"level": subject.units["output"]}),
            **subject.totals(),
        },
        figures=subject.figures(),
        beside=subject.beside(),
    )


GENERIC = GenericExperiment(
    name="release",
    summary="any input falls: time until the output is empty, and what is left of it",
    options=Options,
    signals={"input": "stimulus", "output": "recording"},
    defaults={
        "start": 1.0, "end": 0.0, "t_ramp": 0.0, "empty": 0.02, "duration": 1.0, "record": 1e-3,
        "settle": 1.0,
    },
    build=build,
)  # fmt: skip
