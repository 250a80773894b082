"""Open loop: any course of any input."""

from __future__ import annotations

from bywire.bench.experiment import Experiment
from bywire.bench.generic_experiment import GenericExperiment, TestedModel
from bywire.bench.kpis import extremes
from bywire.bench.stimulus import required_stimulus
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


def build(subject: TestedModel) -> Experiment:
    """Return the experiment of a model, judged by the extremes of the output."""
    return subject.experiment(
        lambda options, stimuli: required_stimulus(stimuli.get(""), "open-loop").sample,
        {"extremes": lambda options: extremes.Setting(subject.output)},
        driven_unit=lambda _: subject.units["input"],
    )


GENERIC = GenericExperiment(
    name="open-loop",
    summary="any stimulus at any input",
    options=Options,
    signals={"input": "stimulus", "output": "recording"},
    defaults={"duration": 1.0, "record": 1e-3, "settle": 0.0},
    build=build,
)
