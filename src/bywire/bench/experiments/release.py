"""Release: an input falls from one level to another, and the output follows."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from bywire.bench.experiment import Experiment
from bywire.bench.generic_experiment import (
    Course,
    GenericExperiment,
    InputLevel,
    TestedModel,
)
from bywire.bench.kpis import release
from bywire.bench.stimulus import Stimulus
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Duration, TimeConstant, Unit

OutputLevel = Annotated[float, Unit("output"), Field(allow_inf_nan=False)]


class Options(ParameterSet):
    """The release, from time zero on."""

    input: str
    """falling stimulus of the model (default: its only stimulus)"""
    output: str
    """released signal of the recording (default: the first one with the input's unit)"""
    start: InputLevel
    """input before the release"""
    end: InputLevel
    """input after the release"""
    t_ramp: TimeConstant
    """time for the input to fall; 0 for a step"""
    empty: OutputLevel
    """level below which the output is considered released"""
    duration: Duration
    """duration of the recording after the start of the release"""
    record: Duration
    """recording interval"""
    settle: TimeConstant
    """time before the release for the output to build up"""


def build(tested: TestedModel) -> Experiment:
    """Return the experiment for a model, judged by the time to empty and the residual level."""

    def course(options: Any, _: Mapping[str, Stimulus]) -> Course:
        ramp, fall = max(options.t_ramp, 1e-9), options.end - options.start
        return lambda t: options.start + fall * np.clip(t / ramp, 0.0, 1.0)

    return tested.experiment(
        course, {"release": lambda options: release.Setting(tested.output, options.empty)}
    )


GENERIC = GenericExperiment(
    name="release",
    summary="drop in any input: time until the output is released, and its residual level",
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
