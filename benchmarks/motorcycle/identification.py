"""Identification of seal friction from the slow ramp, compared with SciPy with differences."""

from __future__ import annotations

from functools import partial
from statistics import median
from typing import cast

import numpy as np
from scipy import optimize

from benchmarks.result import Result, at_least, at_most
from benchmarks.suite import Part
from benchmarks.timing import processor_timed, timed
from bywire.bench.experiment import as_run
from bywire.brakes.motorcycle.experiments.friction_ramp import EXPERIMENT
from bywire.brakes.motorcycle.methods.friction_ramp import METHOD, Options, shots_of
from bywire.brakes.motorcycle.methods.stick_slip import BEFORE, Shooting, Shot, onset_of, overlaid
from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.core.catalog import parameters
from bywire.core.typing import Array
from bywire.identification.method import Effort
from bywire.identification.unknown import Unknown, parameters_of, scattered
from bywire.simulation.run import simulate

STARTS = 16
_ROUNDS, _PEER_STARTS = 3, 2
_SEED = 1


def measured(par: MotorcycleParameters) -> list[Result]:
    """Measure a whole identification with 50 s at 1 kHz, seven unknowns and 16 starts."""
    options = METHOD.defaults
    assert isinstance(options, Options)
    data = METHOD.synthetic(par, options, _SEED)
    case = EXPERIMENT.cases(par, EXPERIMENT.defaults, None)[0]
    plain = processor_timed(partial(simulate, as_run(case, 20e-6), ("p_mc",)))
    identify = partial(METHOD.identify, data, par, options, Effort(starts=STARTS, seed=_SEED))
    ours = processor_timed(identify)
    shots = shots_of(data, options)
    unknowns = parameters_of(par, METHOD.unknowns)
    starts = scattered(unknowns, STARTS, 0.3, _SEED)[1 : 1 + _PEER_STARTS]
    shooting = Shooting(par, unknowns, options.step)
    peer = timed(partial(_by_scipy, shooting, shots, unknowns, starts, options))
    plain()
    seconds = [(plain(), ours(), plain()) for _ in range(_ROUNDS)]
    in_runs = median(2.0 * b / (a + c) for a, b, c in seconds)
    whole, on_all_cores = median(b for _, b, _ in seconds), timed(identify)()
    peer_seconds = peer() * STARTS / _PEER_STARTS
    return [
        at_most(
            "identify.ramp_in_runs",
            in_runs,
            90.0,
            "runs",
            f"seal friction from a ramp of 50 s at 1 kHz, {len(unknowns)} unknowns, {STARTS} "
            f"starts, including uncertainty and replay, {whole:.3g} s of CPU time, relative to "
            "one plain run of the ramp",
        ),
        at_least(
            "identify.scipy",
            peer_seconds / on_all_cores,
            5.0,
            "times faster",
            "wall-clock time of the same on all cores, relative to scipy.optimize.least_squares "
            "with its own differences, the same slips and the same kernel, one start after "
            f"another; {_PEER_STARTS} starts measured, extrapolated to {STARTS} starts, "
            f"{peer_seconds:.3g} s",
        ),
    ]


def _by_scipy(
    shooting: Shooting,
    shots: list[Shot],
    unknowns: tuple[Unknown, ...],
    starts: tuple[Array, ...],
    options: Options,
) -> None:
    scale = np.array([u.scale for u in unknowns])

    def residuals(z: Array) -> Array:
        parts = []
        for shot in shots:
            run, current, _ = shooting.run(shot, z * scale)
            r, _, shift = overlaid(shot, simulate(run, ("p_mc",))["p_mc"])
            level, _ = onset_of(shot, shift + BEFORE)
            parts.append(np.append(r / options.sigma_p, (level - current) / options.scatter))
        return np.concatenate(parts)

    bounds = (np.array([u.low for u in unknowns]) / scale, [u.high / u.scale for u in unknowns])
    for start in starts:
        optimize.least_squares(
            residuals, start / scale, bounds=bounds, x_scale="jac", ftol=1e-5, max_nfev=60
        )


PART = Part(
    "identification", lambda: measured(cast(MotorcycleParameters, parameters("dardanelli2010")))
)
