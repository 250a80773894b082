"""Frequency responses in one ensemble, and linear models compared with python-control."""

from __future__ import annotations

from functools import partial
from statistics import median
from typing import cast

import numpy as np

from benchmarks.linear_batch import linearize_many
from benchmarks.peers.python_control import by_differences, nonlinear_system
from benchmarks.result import Result, at_least, at_most
from benchmarks.suite import Part
from benchmarks.timing import interleaved, ratio, timed
from bywire.analysis.linear.linearize import linearize
from bywire.analysis.linear.sampled_loops import closed_loop
from bywire.analysis.loop import LOOPS
from bywire.analysis.response.frequency_response import frequency_response
from bywire.analysis.response.sweep import Sweep
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.core.catalog import parameters

FREQUENCIES = tuple(np.geomspace(1.0, 100.0, 40).tolist())
AMPLITUDES = (0.5, 1.0, 2.0)
BANDWIDTHS = [12.0, 60.0]
BATCH = 1000
"""number of operating points to linearize at once"""
_ROUNDS, _PAIRS = 15, 2


def measured(par: WedgeParameters) -> list[Result]:
    """Measure all figures of frequency responses and linear models."""
    return [ensemble(par), *linear_models(par)]


def ensemble(par: WedgeParameters) -> Result:
    """Compare Figs. 5 and 6 as one ensemble with the same runs one after another."""
    loop = LOOPS.find("screw-position")
    sweep = Sweep(
        loop.inputs,
        loop.output,
        FREQUENCIES,
        AMPLITUDES,
        {"control.position.f_n": BANDWIDTHS},
        flags=(),
    )
    run = loop.point(par, 0.0).run()
    together = timed(partial(frequency_response, run, sweep))
    apart = timed(partial(frequency_response, run, sweep, lanes=False))
    together()  # warm-up; the other function is long enough not to need it
    pairs = [(together(), apart()) for _ in range(_PAIRS)]
    seconds = {"together": [a for a, _ in pairs], "apart": [b for _, b in pairs]}
    count = len(FREQUENCIES) * len(AMPLITUDES) * len(BANDWIDTHS)
    return at_least(
        "frequency.ensemble",
        ratio(seconds, "apart", "together"),
        5.0,
        "times faster",
        f"{count} sines of Figs. 5 and 6, each until it repeats: "
        f"{median(seconds['together']):.2g} s on all cores and lanes, "
        f"{median(seconds['apart']):.2g} s with compiled single runs on one core, which also "
        "compute energies",
    )


def linear_models(par: WedgeParameters) -> list[Result]:
    """Measure the linear model of the closed loop, and compare the plant with python-control."""
    loop = LOOPS.find("moment")
    point = loop.point(loop.smooth(par), loop.at.default)
    names = tuple(point.model.Memory._fields)
    closed = partial(
        closed_loop,
        point.model,
        point.par,
        point.state,
        point.memory,
        inputs=loop.inputs,
        outputs=(loop.output,),
        stimulus=point.stimulus,
    )
    exact = partial(
        linearize,
        point.model,
        point.par,
        point.state,
        point.memory,
        inputs=names,
        outputs=point.model.State._fields,
    )
    states, memories = (np.repeat([one], BATCH, axis=0) for one in (point.state, point.memory))
    batch = partial(
        linearize_many,
        point.model,
        point.par,
        states,
        memories,
        inputs=names,
        outputs=(),
    )
    system = nonlinear_system(point)
    seconds = interleaved(
        {
            "closed": timed(closed),
            "one": timed(exact),
            "batch": timed(batch),
            "peer": timed(partial(by_differences, system, point)),
        },
        _ROUNDS,
    )
    A = exact().A
    difference = float(np.abs(by_differences(system, point) - A).max() / np.abs(A).max())
    return [
        at_most(
            "linearize.single",
            1e3 * median(seconds["closed"]),
            10.0,
            "ms",
            "closed wedge brake with its moment, position and current control at "
            f"{loop.at.default:g} N m, lifted to 1 ms, already built; on a busy machine most of "
            "the time is waiting for the threads of the matrix exponential",
        ),
        at_least(
            "linearize.python_control",
            BATCH * ratio(seconds, "peer", "batch"),
            50.0,
            "times faster",
            "exact Jacobians of the wedge brake's continuous part, "
            f"{1e6 * median(seconds['batch']) / BATCH:.2g} us per point in a batch of {BATCH}; "
            "control.linearize (differences) of the same equations as a NonlinearIOSystem "
            f"takes {1e3 * median(seconds['peer']):.2g} ms; entries of A differ by "
            f"{difference:.1g} of the largest",
        ),
        Result(
            "linearize.python_control.one",
            ratio(seconds, "peer", "one"),
            "times faster",
            note="the same for a single call of linearize, "
            f"{1e3 * median(seconds['one']):.2g} ms, mostly for conversion to Python numbers",
        ),
    ]


PART = Part(
    "frequency responses", lambda: measured(cast(WedgeParameters, parameters("roberts2003")))
)
