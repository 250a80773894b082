"""A controlled stop of the two-wheeler, compared with hand-written C."""

from __future__ import annotations

from typing import cast

from benchmarks.result import Result, at_most
from benchmarks.suite import Part
from benchmarks.timing import interleaved, kernel, least_ratio
from benchmarks.two_wheeler.hand_stop import HandWrittenStop
from bywire.bench.experiment import as_run
from bywire.brakes.two_wheeler.experiments.straight_stop import STRAIGHT_STOP, StraightStopOptions
from bywire.brakes.two_wheeler.parameters import TwoWheelerParameters
from bywire.core.catalog import parameters
from bywire.simulation.run import Run

_ROUNDS, _STEP, _DURATION = 20, 20e-6, 4.5


def controlled_stop(par: TwoWheelerParameters) -> Run:
    """Return a slip-controlled stop from 30 m/s on wet asphalt, and half a second at standstill."""
    options = cast(StraightStopOptions, STRAIGHT_STOP.defaults)
    wet = options.replace({"surface": "wet-asphalt", "v_0": 30.0, "duration": _DURATION})
    case, *_ = STRAIGHT_STOP.cases(par, wet, None)
    return as_run(case, _STEP)


def single() -> list[Result]:
    """Compare one controlled stop with hand-written C."""
    run = controlled_stop(cast(TwoWheelerParameters, parameters("sport600")))
    par = cast(TwoWheelerParameters, run.par)
    opponent = HandWrittenStop(par).single(run)
    seconds = interleaved({"bywire": kernel(run), "hand": opponent}, _ROUNDS)
    substeps = opponent.substeps
    return [
        at_most(
            "vehicle.single.hand_c",
            least_ratio(seconds, "bywire", "hand"),
            0.9,
            "ratio",
            f"one slip-controlled stop of {run.duration:g} s, all outputs, relative to "
            "hand-written C; same scheme, compiler and flags, one call each, minimum "
            "processor times",
        ),
        Result(
            "vehicle.single.substep",
            1e9 * min(seconds["bywire"]) / substeps,
            "ns",
            note="one substep of vehicle, brakes and energy balances, in one call of the kernel",
        ),
    ]


PART = Part("vehicle", single)
