"""Duty: an input is held, or comes again and again, until the motor is warm."""

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
    """The applications, from time zero on."""

    input: str
    """stimulus of the model that is applied; its only one unless given"""
    output: str
    """recorded signal that answers; the first one of the input's unit unless given"""
    start: InputLevel
    """input between the applications"""
    end: InputLevel
    """input while applied"""
    period: Duration
    """time from one application to the next"""
    share: Share
    """share of it in which the input is applied; 1 holds it"""
    duration: Duration
    """time recorded"""
    record: Duration
    """recording interval"""
    settle: TimeConstant
    """time before the first application"""


def build(subject: TestedModel) -> Experiment:
    """Return the experiment of a model, judged by how warm it gets and what is left then."""

    def course(options: Any, _: Mapping[str, Stimulus]) -> Course:
        def applied(t: Any) -> Any:
            since = np.mod(t + TOLERANCE, options.period)
            on = reached(t, 0.0) & (since < options.share * options.period)
            return np.where(on, options.end, options.start)

        return applied

    return subject.experiment(course, {"warming": lambda _: warming.Setting(subject.output)})


GENERIC = GenericExperiment(
    name="duty",
    summary="any input held, or applied again and again: how warm motors get, when they derate",
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
