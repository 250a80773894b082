"""Single runs, ensembles and sensitivities, compared with hand-written C."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import cast

import numpy as np

from benchmarks.motorcycle.hand_c import WITHOUT_SUMS, HandWritten
from benchmarks.motorcycle.problem import braking_run, hard_braking
from benchmarks.result import Result, at_least, at_most, vector_doubles
from benchmarks.suite import Part
from benchmarks.timing import (
    Work,
    interleaved,
    kernel,
    least_ratio,
    processor_timed,
)
from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.core.catalog import parameters
from bywire.simulation.compiler import SINGLE
from bywire.simulation.ensemble import case_matrix, simulate_ensemble
from bywire.simulation.run import Run, simulate
from bywire.simulation.sensitivity import simulate_with_sensitivities

CASES = 1024
VARIED = ("motor.R_m", "motor.K_e", "seal.T_pr", "seal.f_cfr_p", "caliper.K_pd", "fluid.beta")
DIRECTIONS = (
    "motor.R_m",
    "motor.K_e",
    "seal.T_pr",
    "seal.f_cfr_p",
    "caliper.K_pd",
    "fluid.beta",
    "gear.J_mot",
    "pipeline.d_pl",
)
_ROUNDS, _ENSEMBLE_ROUNDS = 60, 7
_PER_DOUBLE = 6.5 / 8  # goal of the ensemble for each double of a vector


def single_and_sensitivities(par: MotorcycleParameters) -> list[Result]:
    """Compare one hard-braking run with hand-written C, and measure the cost of eight tangents."""
    run = braking_run(par, hard_braking)
    ideal = replace(run, par=par.replace({"adc.law": "ideal"}))
    seconds = interleaved(
        {
            "bywire": kernel(run),
            "hand": HandWritten(par).single(run),
            "plain": processor_timed(partial(simulate, ideal, ("p_mc", "omega"))),
            "tangents": processor_timed(
                partial(simulate_with_sensitivities, ideal, DIRECTIONS, ("p_mc", "omega"))
            ),
        },
        _ROUNDS,
    )
    return [
        at_most(
            "single.hand_c",
            least_ratio(seconds, "bywire", "hand"),
            0.9,
            "ratio",
            "one hard-braking run of 1.2 s, all outputs, relative to hand-written C; same "
            "compiler and flags, one call each, minimum CPU times",
        ),
        Result(
            "single.realtime_factor",
            run.duration / min(seconds["plain"]),
            "1",
            note="simulated time / processor time of a call from Python, including preparation",
        ),
        at_most(
            "sensitivities.plain",
            least_ratio(seconds, "tangents", "plain"),
            4.5,
            "ratio",
            "value and eight directions, relative to a plain run",
        ),
    ]


def ensemble(par: MotorcycleParameters) -> list[Result]:
    """Compare 1,024 variations in lanes with scalar C, one thread each.

    The number of threads is set differently on each side (OMP_NUM_THREADS applies only to OpenMP),
    and both sides distribute whole cases. Therefore the benchmark compares the time of one core.
    """
    run = braking_run(par, hard_braking)
    signals = ("p_mc", "i", "stuck")
    draw = np.random.default_rng(0)
    leaves = par.leaves()
    variations = {n: leaves[n] * draw.uniform(0.9, 1.1, CASES) for n in VARIED}
    opponent = _hand_ensemble(run, variations, signals)
    seconds = interleaved(
        {
            "bywire": processor_timed(
                partial(simulate_ensemble, run, variations, signals, threads=1)
            ),
            "hand": processor_timed(opponent),
        },
        _ENSEMBLE_ROUNDS,
    )
    width = vector_doubles()
    return [
        at_least(
            "ensemble.hand_c",
            least_ratio(seconds, "hand", "bywire"),
            _PER_DOUBLE * width,
            "times faster",
            f"{CASES} variations of {len(VARIED)} parameters, three signals and no energies "
            "on both sides, relative to scalar C with the flags of a single run; minimum "
            "processor times of one thread each, in turn; the goal is 6.5 for vectors of eight "
            f"doubles, in proportion to the width of {width} doubles",
        ),
    ]


def _hand_ensemble(run: Run, variations: dict[str, np.ndarray], signals: tuple[str, ...]) -> Work:
    matrix, names = case_matrix(run, variations), list(run.par.leaves())
    par = cast(MotorcycleParameters, run.par)
    cases = [par.with_leaves(dict(zip(names, column, strict=True))) for column in matrix.T]
    return HandWritten(par, (*SINGLE, *WITHOUT_SUMS)).ensemble(run, cases, signals)


def _par() -> MotorcycleParameters:
    return cast(MotorcycleParameters, parameters("dardanelli2010"))


PARTS = (
    Part("single run", lambda: single_and_sensitivities(_par())),
    Part("ensemble", lambda: ensemble(_par())),
)
