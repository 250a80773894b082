"""Ramp: an input moves slowly up and down, to show the hysteresis of friction and backlash."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import Field

from bywire.bench.experiment import Experiment
from bywire.bench.generic_experiment import (
    Course,
    GenericExperiment,
    InputLevel,
    TestedModel,
)
from bywire.bench.kpis import extremes, hysteresis
from bywire.bench.stimuli import ramp
from bywire.bench.stimulus import Stimulus
from bywire.core.errors import not_valid
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Duration, TimeConstant, Unit
from bywire.core.units import shown

InputRate = Annotated[float, Unit("input/s"), Field(gt=0, allow_inf_nan=False)]


class Options(ParameterSet):
    """The ramp, from time zero on."""

    input: str
    """ramped stimulus of the model (default: its only stimulus)"""
    output: str
    """recorded signal that responds (default: the first one with the input's unit)"""
    drive: str
    """input or recorded signal that drives the loop, such as a current (default: the input)"""
    start: InputLevel
    """input value at the beginning and at the end of the run"""
    end: InputLevel
    """input value at the turning point"""
    slope: InputRate
    """magnitude of the slope, in both directions"""
    t_hold: TimeConstant
    """time spent at the turning point"""
    record: Duration
    """recording interval"""
    settle: TimeConstant
    """time before the ramp, at its first level"""
    smoothing: TimeConstant
    """averaging time for the loop's key figures; 0 for the raw signals"""


def build(tested: TestedModel) -> Experiment:
    """Return the experiment for a model, judged by its loop and the extremes of the output."""
    drive, unit = tested.units["drive"], tested.units["input"]

    def course(options: Any, _: Mapping[str, Stimulus]) -> Course:
        if options.start == options.end:
            raise not_valid("options.end", shown(options.end, unit), "different from options.start")
        shape = ramp.Parameters(
            start=options.start,
            end=options.end,
            slope=options.slope,
            t_start=0.0,
            t_hold=options.t_hold,
            after="return",
        )
        return lambda t: ramp.sample(t, shape)

    def duration(options: Any) -> float:
        return float(2.0 * abs(options.end - options.start) / options.slope + options.t_hold)

    def loop(options: Any) -> hysteresis.Setting:
        return hysteresis.Setting(
            tested.names["drive"], tested.output, options.smoothing, demand=tested.input
        )

    return tested.experiment(
        course,
        {"hysteresis": loop, "extremes": lambda options: extremes.Setting(tested.output)},
        "hysteresis-loop",
        duration=duration,
        resolved={"drive": drive, "drive*response": f"{drive}*{tested.units['output']}"},
        loop=loop,
    )


GENERIC = GenericExperiment(
    name="ramp",
    summary="slow ramp of any input up and back down: hysteresis loop of any output",
    options=Options,
    signals={"input": "stimulus", "output": "recording", "drive": "input or recording"},
    defaults={
        "start": 0.0,
        "end": 1.0,
        "slope": 0.1,
        "t_hold": 0.0,
        "record": 1e-3,
        "settle": 0.0,
        "smoothing": 0.0,
    },
    build=build,
)
