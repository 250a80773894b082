"""Release: an input falls from one level to another, and the output with it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from bywire.bench.experiment import Experiment
from bywire.bench.generic_experiment import (
    Course,
    GenericExperiment,
    InputLevel,
    OutputLevel,
    TestedModel,
)
from bywire.bench.kpis import release
from bywire.bench.stimulus import Stimulus
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


def build(subject: TestedModel) -> Experiment:
    """Return the experiment of a model, judged by the time to empty and what is left."""

    def course(options: Any, _: Mapping[str, Stimulus]) -> Course:
        ramp, fall = max(options.t_ramp, 1e-9), options.end - options.start
        return lambda t: options.start + fall * np.clip(t / ramp, 0.0, 1.0)

    return subject.experiment(
        course, {"release": lambda options: release.Setting(subject.output, options.empty)}
    )


GENERIC = GenericExperiment(
    name="release",
    summary="any input falls: time until the output is empty, and what is left of it",
    options=Options,
    signals={"input": "stimulus", "output": "recording"},
    defaults={
        "start": 1.0,
        "end": 0.0,
        "t_ramp": 0.0,
        "empty": 0.02,
        "duration": 1.0,
        "record": 1e-3,
        "settle": 1.0,
    },
    build=build,
)
