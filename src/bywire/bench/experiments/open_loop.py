"""Open loop: any stimulus at any input."""

from __future__ import annotations

from bywire.bench.experiment import Experiment
from bywire.bench.generic_experiment import GenericExperiment, TestedModel
from bywire.bench.kpis import extremes
from bywire.bench.stimulus import required_stimulus
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Duration, TimeConstant


class Options(ParameterSet):
    """Driven input and judged output."""

    input: str
    """stimulus of the model that [stimulus] drives (default: its only stimulus)"""
    output: str
    """recorded signal to evaluate (default: the first one with the input's unit)"""
    duration: Duration
    """duration of the run"""
    record: Duration
    """recording interval"""
    settle: TimeConstant
    """time before time zero, at the stimulus's first value"""


def build(tested: TestedModel) -> Experiment:
    """Return the experiment for a model, judged by the extremes of the output."""
    return tested.experiment(
        lambda options, stimuli: required_stimulus(stimuli.get(""), "open-loop").sample,
        {"extremes": lambda options: extremes.Setting(tested.output)},
        driven_unit=lambda _: tested.units["input"],
    )


GENERIC = GenericExperiment(
    name="open-loop",
    summary="any stimulus at any input",
    options=Options,
    signals={"input": "stimulus", "output": "recording"},
    defaults={"duration": 1.0, "record": 1e-3, "settle": 0.0},
    build=build,
)
