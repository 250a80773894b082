"""Step: an input jumps from one level to another."""

from __future__ import annotations

from typing import Any

import numpy as np

from bywire.bench.experiment import Experiment
from bywire.bench.generic_experiment import GenericExperiment, InputLevel, TestedModel
from bywire.bench.kpis import step_response
from bywire.bench.stimulus import reached
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Duration, TimeConstant


class Options(ParameterSet):
    """The step, at time zero."""

    input: str
    """stepped stimulus of the model (default: its only stimulus)"""
    output: str
    """recorded signal that responds (default: the first one with the input's unit)"""
    start: InputLevel
    """input before the step"""
    end: InputLevel
    """input after the step"""
    duration: Duration
    """duration of the recording after the step"""
    record: Duration
    """recording interval"""
    settle: TimeConstant
    """time before the step, at its first level"""
    smoothing: TimeConstant
    """averaging time for the step's key figures; 0 for the raw output"""


def build(tested: TestedModel) -> Experiment:
    """Return the experiment for a model, judged by its step response."""

    def step(options: Any) -> step_response.Setting:
        """Return the step's setting; without a set point, the response determines its levels."""
        if not tested.is_set_point:
            return step_response.Setting(tested.output, 0.0, smoothing=options.smoothing)
        return step_response.Setting(
            tested.output,
            0.0,
            options.start,
            options.end,
            smoothing=options.smoothing,
            set_point=tested.input,
        )

    return tested.experiment(
        lambda options, _: lambda t: np.where(reached(t, 0.0), options.end, options.start),
        {"step_response": step},
        "step-response",
        step=step,
    )


GENERIC = GenericExperiment(
    name="step",
    summary="step of any input: rise time, settling time and overshoot of any output",
    options=Options,
    signals={"input": "stimulus", "output": "recording"},
    defaults={
        "start": 0.0,
        "end": 1.0,
        "duration": 1.0,
        "record": 1e-3,
        "settle": 0.0,
        "smoothing": 0.0,
    },
    build=build,
)
