"""Single runs, ensembles and sensitivities against hand-written C."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from statistics import median
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
    ratio,
    timed,
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


def single_and_sensitivities(par: MotorcycleParameters) -> list[Result]:
    """Measure one hard-braking run against hand-written C, and the price of eight tangents."""
    run = braking_run(par, hard_braking)
    ideal = replace(run, par=par.replace({"adc.law": "ideal"}))
    seconds = interleaved(
        {
            "bywire": kernel(run),
            "hand": HandWritten(par).single(run),
            "plain": timed(partial(simulate, ideal, ("p_mc", "omega"))),
            "tangents": timed(
                partial(simulate_with_sensitivities, ideal, DIRECTIONS, ("p_mc", "omega"))
            ),
        },
        _ROUNDS,
    )
    plain = median(seconds["plain"])
    return [
        at_most(
            "single.hand_c",
            ratio(seconds, "bywire", "hand"),
            1.0,
            "ratio",
            "one hard-braking run of 1.2 s, all outputs, over hand-written C; same compiler "
            "and flags, one call each",
        ),
        Result(
            "single.realtime_factor",
            run.duration / plain,
            "1",
            note="simulated over wall time, a call from Python with all its preparation",
        ),
        at_most(
            "sensitivities.plain",
            ratio(seconds, "tangents", "plain"),
            4.5,
            "ratio",
            "eight directions with the value over a plain run",
        ),
    ]


def ensemble(par: MotorcycleParameters) -> list[Result]:
    """Measure 1,024 variations in lanes against scalar C, a thread each.

    How many threads either side would take is set in different places (OMP_NUM_THREADS holds for
    OpenMP alone), and both share out whole cases: a core's time is what differs.
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
            0.7 * width,
            "times faster",
            f"{CASES} variations of {len(VARIED)} parameters, three signals and no energies "
            "on both sides, over scalar C with the flags of a single run; least processor "
            f"times of a thread each, in turn; 0.7 of the vector width, {width} doubles",
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
