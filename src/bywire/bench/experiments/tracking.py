"""Tracking: an output follows a moving input, for example from a recorded pedal signal."""

from __future__ import annotations

from typing import Any

from bywire.bench.experiment import Experiment
from bywire.bench.generic_experiment import GenericExperiment, TestedModel
from bywire.bench.kpis import tracking
from bywire.bench.stimulus import required_stimulus
from bywire.core.errors import ParameterError
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Duration, TimeConstant


class Options(ParameterSet):
    """Set point and output."""

    input: str
    """set point: stimulus of the model that [stimulus] drives (default: its only stimulus)"""
    output: str
    """recorded signal that follows the set point (default: the first one in the same unit)"""
    duration: Duration
    """duration of the run"""
    record: Duration
    """recording interval"""
    settle: TimeConstant
    """time before time zero, at the stimulus's first value"""
    smoothing: TimeConstant
    """averaging time for the tracking key figures; 0 for the raw output"""


def build(tested: TestedModel) -> Experiment:
    """Return the experiment for a model, judged by how well the output follows.

    Raises
    ------
    ParameterError
        When the output's unit differs from the input's.
    """
    if not tested.is_set_point:
        raise ParameterError(
            f"options.output = {tested.output} is in {tested.units['output']}, but the set point "
            f"{tested.input} is in {tested.units['input']}. Choose an output in "
            f"{tested.units['input']}",
            name="options.output",
            value=tested.output,
            valid=f"an output in {tested.units['input']}",
        )

    def followed(options: Any) -> tracking.Setting:
        return tracking.Setting(tested.output, tested.input, options.smoothing)

    return tested.experiment(
        lambda options, stimuli: required_stimulus(stimuli.get(""), "tracking").sample,
        {"tracking": followed},
        "tracking",
        followed=followed,
        driven_unit=lambda _: tested.units["input"],
    )


GENERIC = GenericExperiment(
    name="tracking",
    summary="any output follows a moving set point, for example a table from a file",
    options=Options,
    signals={"input": "stimulus", "output": "recording"},
    defaults={"duration": 1.0, "record": 1e-3, "settle": 0.0, "smoothing": 0.0},
    build=build,
)
