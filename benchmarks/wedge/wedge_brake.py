"""The wedge brake compared with hand-written C, and with the usual regularized friction."""

from __future__ import annotations

from functools import partial
from statistics import median
from typing import cast

import numpy as np

from benchmarks.peers.hand_code import WITHOUT_SUMS
from benchmarks.result import Result, at_least, at_most, vector_doubles
from benchmarks.suite import Part
from benchmarks.timing import (
    Work,
    interleaved,
    kernel,
    least_ratio,
    processor_timed,
    timed,
)
from benchmarks.wedge import tanh_rk4
from benchmarks.wedge.hand_wedge import HandWrittenWedge
from bywire.bench.experiment import as_run
from bywire.brakes.wedge.experiments.moment_tests import MOMENT_PULSES, PulsesOptions
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.core.catalog import parameters
from bywire.core.typing import Array
from bywire.simulation.compiler import SINGLE
from bywire.simulation.ensemble import case_matrix, simulate_ensemble
from bywire.simulation.run import Run, simulate

STEP = 20e-6
FINE = 1e-6
CASES = 256
VARIED = (
    "wedge.mu_B",
    "caliper.K_cal",
    "bearing.C_0",
    "motor_1.K_ref",
    "motor_1.J_M",
    "screw.lead",
    "heart.K_W",
    "wedge_friction.mu_int",
)
SIGNALS = ("x", "y_M", "i_1")
_ROUNDS, _ENSEMBLE_ROUNDS = 30, 3
_PER_DOUBLE = 7.5 / 8  # goal of the ensemble for each double of a vector
# Regularized friction: the step at which a run takes one second, and the widths with the least
# error at this step.
_WIDTH, _WIDTH_V, _TANH_STEP = 0.03, 1e-5, 1e-6


def fig7(par: WedgeParameters, step: float = STEP) -> Run:
    """Return the run of Fig. 7, a step of the moment demand and then pulses."""
    options = cast(PulsesOptions, MOMENT_PULSES.defaults)
    case, *_ = MOMENT_PULSES.cases(par, options, None)
    return as_run(case, step)


def measured(par: WedgeParameters) -> list[Result]:
    """Measure all figures of the wedge brake."""
    return [*single(par), *ensemble(par), *regularized(par)]


def single(par: WedgeParameters) -> list[Result]:
    """Measure one run of Fig. 7 against hand-written C."""
    run = fig7(par)
    opponent = HandWrittenWedge(par).single(run)
    seconds = interleaved(
        {
            "bywire": kernel(run),
            "hand": opponent,
            "plain": processor_timed(partial(simulate, run, ("y_M", "x"))),
        },
        _ROUNDS,
    )
    passes = opponent.extra / opponent.substeps
    return [
        at_most(
            "wedge.single.hand_c",
            least_ratio(seconds, "bywire", "hand"),
            0.9,
            "ratio",
            f"one run of Fig. 7, {run.duration:g} s, all outputs, relative to hand-written C "
            f"with a fully iterated implicit midpoint, {passes:.2f} passes per substep; same "
            "compiler and flags, one call each, minimum CPU times",
        ),
        Result(
            "wedge.single.realtime_factor",
            run.duration / min(seconds["plain"]),
            "1",
            note="simulated time / processor time of a call from Python, including preparation",
        ),
    ]


def ensemble(par: WedgeParameters) -> list[Result]:
    """Compare 256 variations in lanes with scalar C, one thread each."""
    run = fig7(par)
    draw = np.random.default_rng(0)
    leaves = par.leaves()
    variations = {n: leaves[n] * draw.uniform(0.9, 1.1, CASES) for n in VARIED}
    seconds = interleaved(
        {
            "bywire": processor_timed(
                partial(simulate_ensemble, run, variations, SIGNALS, threads=1)
            ),
            "hand": processor_timed(_hand_ensemble(run, variations)),
        },
        _ENSEMBLE_ROUNDS,
    )
    width = vector_doubles()
    return [
        at_least(
            "wedge.ensemble.hand_c",
            least_ratio(seconds, "hand", "bywire"),
            _PER_DOUBLE * width,
            "times faster",
            f"{CASES} variations of {len(VARIED)} parameters, three signals and no energies "
            "on both sides, relative to scalar C with the flags of a single run; minimum "
            "processor times of one thread each, in turn; the goal is 7.5 for vectors of eight "
            f"doubles, in proportion to the width of {width} doubles",
        ),
    ]


def _hand_ensemble(run: Run, variations: dict[str, Array]) -> Work:
    matrix, names = case_matrix(run, variations), list(run.par.leaves())
    par = cast(WedgeParameters, run.par)
    cases = [par.with_leaves(dict(zip(names, column, strict=True))) for column in matrix.T]
    return HandWrittenWedge(par, (*SINGLE, *WITHOUT_SUMS)).ensemble(run, cases, SIGNALS)


def regularized(par: WedgeParameters) -> list[Result]:
    """Measure how much faster bywire is than tanh friction with explicit steps.

    Notes
    -----
    The table shows the root-mean-square error of the wedge travel, and the time on one machine,
    where bywire takes 0.03 s with an error of 0.17 nm (20 us) and 0.003 s with 10 nm (200 us):

    ======  ==========  =========  ==========  =======
    rad/s   m/s         step [us]  error [nm]  seconds
    ======  ==========  =========  ==========  =======
    0.1     3e-5        10         700         0.11
    0.03    1e-5        5          450         0.19
    0.03    1e-5        2          240         0.48
    0.01    1e-5        1          160         0.97
    0.01    3e-6        0.2        68          5.0
    ======  ==========  =========  ==========  =======
    """
    ideal = par.replace({"encoder.law": "ideal"})  # one encoder count would hide small errors
    run = fig7(ideal)
    exact = simulate(fig7(ideal, FINE), tanh_rk4.SIGNALS)
    own = simulate(run, tanh_rk4.SIGNALS)
    before = _plain(run)
    solution = tanh_rk4.solve(run, _WIDTH, _WIDTH_V, _TANH_STEP)
    seconds = median((*before, *_plain(run)))
    errors = [_rms(own[name] - exact[name]) for name in tanh_rk4.SIGNALS]
    others = [_rms(solution.x - exact["x"]), _rms(solution.y_M - exact["y_M"])]
    better = any(theirs < ours for theirs, ours in zip(others, errors, strict=True))
    note = (
        f"tanh of {_WIDTH:g} rad/s and {_WIDTH_V:g} m/s, RK4 with {_TANH_STEP * 1e6:g} us in C; "
        f"RMS errors: bywire {errors[0] * 1e9:.2g} nm and {errors[1]:.2g} N m, "
        f"tanh {others[0] * 1e9:.2g} nm and {others[1]:.2g} N m"
    )
    note += "; the peer is more accurate here" if better else "; at equal error it is even slower"
    return [at_least("wedge.peer.tanh_rk4", solution.seconds / seconds, 20.0, "times faster", note)]


def _rms(error: Array) -> float:
    return float(np.sqrt(np.mean(error**2)))


def _plain(run: Run) -> tuple[float, ...]:
    work = timed(partial(simulate, run, tanh_rk4.SIGNALS))
    return tuple(work() for _ in range(7))


PART = Part("wedge brake", lambda: measured(cast(WedgeParameters, parameters("roberts2003"))))
