"""Sine sweep: sines of increasing frequency at an input, each over whole periods."""

from __future__ import annotations

import math
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
from bywire.bench.kpis import sine_sweep
from bywire.bench.stimulus import Stimulus
from bywire.core.errors import not_valid
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Duration, Frequency, TimeConstant, Unit
from bywire.core.typing import Array
from bywire.core.units import shown

Count = Annotated[int, Unit("1", 5.0), Field(ge=1, le=1000)]

_LEAST_ROWS = 8  # minimum number of rows in the shortest period
InputAmplitude = Annotated[float, Unit("input"), Field(gt=0, allow_inf_nan=False)]


class Options(ParameterSet):
    """The sines, from time zero on."""

    input: str
    """excited stimulus of the model (default: its only stimulus)"""
    output: str
    """recorded signal that responds (default: the first one with the input's unit)"""
    mean: InputLevel
    """mean of the input"""
    amplitude: InputAmplitude
    """amplitude: half the peak-to-peak value"""
    f_start: Frequency
    """lowest frequency"""
    f_end: Frequency
    """highest frequency"""
    n: Count
    """number of frequencies, with logarithmic spacing"""
    n_settle: Count
    """number of settling periods at each frequency"""
    n_periods: Count
    """number of evaluated periods at each frequency"""
    record: Duration
    """recording interval"""
    settle: TimeConstant
    """time before the first sine, at the mean"""


def build(tested: TestedModel) -> Experiment:
    """Return the experiment for a model, judged by gain, bandwidth and lag."""

    def driven(options: Any, _: Mapping[str, Stimulus]) -> Course:
        _require_rows(options)
        return lambda t: course(t, options)

    def sweep(options: Any) -> sine_sweep.Setting:
        return sine_sweep.Setting(tested.input, tested.output, windows(options))

    gain = sine_sweep.gain_unit(tested.units["input"], tested.units["output"])
    return tested.experiment(
        driven,
        {"sine_sweep": sweep},
        "sine-sweep",
        duration=lambda options: windows(options)[-1][2],
        resolved={"gain": gain},
        sweep=sweep,
    )


def windows(options: Any) -> tuple[tuple[float, float, float], ...]:
    """Return frequency [Hz], and start and end [s] of the evaluated periods, of every sine."""
    spans, begin = [], 0.0
    for f in np.geomspace(options.f_start, options.f_end, options.n):
        settled = begin + options.n_settle / f
        begin = settled + options.n_periods / f
        spans.append((float(f), float(settled), float(begin)))
    return tuple(spans)


def course(t: Array, options: Any) -> Array:
    """Return the input [SI] at times [s]: each sine starts and ends at its mean."""
    phase, begin = np.zeros(t.shape), 0.0
    for f, _, end in windows(options):
        inside = (t >= begin) & (t < end)
        phase = np.where(inside, 2.0 * math.pi * f * (t - begin), phase)
        begin = end
    return np.asarray(options.mean + options.amplitude * np.sin(phase))


def _require_rows(options: Any) -> None:
    """Reject decreasing frequencies, and recordings too coarse for the highest frequency."""
    if options.f_end < options.f_start:
        start = f">= options.f_start = {options.f_start:g} Hz"
        raise not_valid("options.f_end", f"{options.f_end:g} Hz", start)
    longest = 1.0 / (_LEAST_ROWS * options.f_end)
    if options.record > longest:
        advice = f"to resolve sines of {options.f_end:g} Hz"
        raise not_valid(
            "options.record", shown(options.record, "s"), f"<= {shown(longest, 's')}", advice
        )


GENERIC = GenericExperiment(
    name="sine-sweep",
    summary="sines of increasing frequency at any input: gain, bandwidth and lag of any output",
    options=Options,
    signals={"input": "stimulus", "output": "recording"},
    defaults={
        "mean": 0.5,
        "amplitude": 0.1,
        "f_start": 0.5,
        "f_end": 50.0,
        "n": 13,
        "n_settle": 3,
        "n_periods": 5,
        "record": 1e-3,
        "settle": 1.0,
    },
    build=build,
)
