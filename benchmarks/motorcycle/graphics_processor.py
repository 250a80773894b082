"""Ensembles on a graphics processor, compared with the lanes of two cores."""

from __future__ import annotations

from functools import partial
from typing import cast

import numpy as np

from benchmarks.motorcycle.engine import VARIED
from benchmarks.motorcycle.problem import braking_run, hard_braking
from benchmarks.result import Result, at_least, at_most
from benchmarks.suite import Part
from benchmarks.timing import interleaved, processor_timed, timed
from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.core.catalog import parameters
from bywire.core.errors import DeviceError, ParameterError
from bywire.simulation.cuda import find_device
from bywire.simulation.ensemble import simulate_ensemble

LANES, THREADS = 1024, 32_768
"""cases on each side: half a second of work for a core, and one batch for a large processor"""
CORES, RATIO, DIFFERENCE = 2, 50.0, 1e-9
"""number of cores for comparison, and goals"""
_ROUNDS = 3
_SIGNALS = ("p_mc", "i", "stuck")


def measured() -> list[Result]:
    """Measure cases per second of a graphics processor, and check its results."""
    try:
        device = find_device()
    except (DeviceError, ParameterError) as error:
        return [
            Result("study.gpu_ratio", None, "times faster", f">= {RATIO:g}", None, str(error)),
            Result("study.gpu_difference", None, "1", f"<= {DIFFERENCE:g}", None, str(error)),
        ]
    par = cast(MotorcycleParameters, parameters("dardanelli2010"))
    run = braking_run(par, hard_braking)
    draw, leaves = np.random.default_rng(0), par.leaves()
    many = {n: leaves[n] * draw.uniform(0.9, 1.1, THREADS) for n in VARIED}
    few = {name: values[:LANES] for name, values in many.items()}
    in_lanes = partial(simulate_ensemble, run, few, _SIGNALS, threads=1)
    there = partial(simulate_ensemble, run, many, _SIGNALS, engine="cuda")
    seconds = interleaved({"lanes": processor_timed(in_lanes), "gpu": timed(there)}, _ROUNDS)
    lanes, gpu = min(seconds["lanes"]) / LANES, min(seconds["gpu"]) / THREADS
    ours = in_lanes().values
    apart = np.abs(there().values[:LANES] - ours).max(axis=(0, 1)) / np.abs(ours).max(axis=(0, 1))
    return [
        at_least(
            "study.gpu_ratio",
            lanes / CORES / gpu,
            RATIO,
            "times faster",
            f"hard-braking runs per second on {device.label} ({THREADS} variations of "
            f"{len(VARIED)} parameters, wall time, including transfer of the rows), relative to "
            f"lanes on {CORES} cores (from the processor time of {LANES} runs); {1e6 * gpu:.3g} us "
            f"per case, and {1e6 * lanes:.3g} us on one core",
        ),
        at_most(
            "study.gpu_difference",
            float(apart.max()),
            DIFFERENCE,
            "1",
            "maximum difference of a signal between the two, relative to its maximum",
        ),
    ]


PART = Part("graphics processor", measured)
