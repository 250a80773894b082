"""Tracking: an output follows a moving input, for instance a measured pedal."""

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
    """What follows what."""

    input: str
    """stimulus of the model that [stimulus] drives, the set point; its only one unless given"""
    output: str
    """recorded signal that follows, of the same unit; the first one of that unit unless given"""
    duration: Duration
    """length of the run"""
    record: Duration
    """recording interval"""
    settle: TimeConstant
    """time before zero, at the stimulus' first value"""
    smoothing: TimeConstant
    """moving average for the tracking's key figures, 0 for the raw output"""


def build(subject: TestedModel) -> Experiment:
    """Return the experiment of a model, judged by how well the output follows.

    Raises
    ------
    ParameterError
        When the output is of another unit than the input.
    """
    if not subject.is_set_point:
        raise ParameterError(
            f"options.output: {subject.output} is in {subject.units['output']}, and the set point "
            f"{subject.input} in {subject.units['input']}: name an output of that unit"
        )

    def followed(options: Any) -> tracking.Setting:
        return tracking.Setting(subject.output, subject.input, options.smoothing)

    return subject.experiment(
        lambda options, stimuli: required_stimulus(stimuli.get(""), "tracking").sample,
        {"tracking": followed},
        "tracking",
        followed=followed,
        driven_unit=lambda _: subject.units["input"],
    )


GENERIC = GenericExperiment(
    name="tracking",
    summary="any output follows a moving set point, for instance a table out of a file",
    options=Options,
    signals={"input": "stimulus", "output": "recording"},
    defaults={"duration": 1.0, "record": 1e-3, "settle": 0.0, "smoothing": 0.0},
    build=build,
)
