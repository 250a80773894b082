"""Duty: apply an input continuously or periodically until the motor is warm."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from bywire.bench.experiment import Experiment
from bywire.bench.generic_experiment import Course, GenericExperiment, InputLevel, TestedModel
from bywire.bench.kpis import warming
from bywire.bench.stimulus import TOLERANCE, Stimulus, reached
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Duration, TimeConstant, Unit

Share = Annotated[float, Unit("1", 0.5), Field(gt=0, le=1, allow_inf_nan=False)]


class Options(ParameterSet):
    """Applications of the input, from time zero on."""

    input: str
    """applied stimulus of the model (default: its only stimulus)"""
    output: str
    """recorded signal that responds (default: the first one with the input's unit)"""
    start: InputLevel
    """input between the applications"""
    end: InputLevel
    """input while applied"""
    period: Duration
    """time from one application to the next"""
    share: Share
    """fraction of the period in which the input is applied; 1 applies it continuously"""
    duration: Duration
    """duration of the recording"""
    record: Duration
    """recording interval"""
    settle: TimeConstant
    """time before the first application"""


def build(tested: TestedModel) -> Experiment:
    """Return the experiment for a model, judged by its temperatures and its output when warm."""

    def course(options: Any, _: Mapping[str, Stimulus]) -> Course:
        def applied(t: Any) -> Any:
            since = np.mod(t + TOLERANCE, options.period)
            on = reached(t, 0.0) & (since < options.share * options.period)
            return np.where(on, options.end, options.start)

        return applied

    return tested.experiment(course, {"warming": lambda _: warming.Setting(tested.output)})


GENERIC = GenericExperiment(
    name="duty",
    summary="any input, applied continuously or periodically: motor temperatures and derating",
    options=Options,
    signals={"input": "stimulus", "output": "recording"},
    defaults={
        "start": 0.0,
        "end": 1.0,
        "period": 1.0,
        "share": 1.0,
        "duration": 60.0,
        "record": 1e-2,
        "settle": 0.0,
    },
    build=build,
)
