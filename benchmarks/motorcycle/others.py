"""The same braking in other simulators that users would choose instead.

All programs meet the same error: the maximum difference between their pressure at the ECU's ticks
and bywire's with steps of 2.5 us is at most `ERROR`. bywire uses its default step. Each peer uses
the fastest of a few settings that meet the error.
"""

from __future__ import annotations

import importlib
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from statistics import median
from types import ModuleType
from typing import cast

from benchmarks.motorcycle.problem import (
    Solution,
    braking_run,
    error,
    hard_braking,
    reference,
)
from benchmarks.result import Result, at_least, failed
from benchmarks.suite import Part
from benchmarks.timing import processor_timed
from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.core.catalog import parameters
from bywire.simulation.run import simulate


@dataclass(frozen=True)
class Peer:
    """A peer, the goal for bywire's speed relative to the peer, and the simulated time [s]."""

    name: str
    goal: float
    duration: float = 1.2


ERROR = 0.01
"""maximum error of every program [bar]"""
INSTALL = "pip install -r benchmarks/requirements.txt"
PEERS = (
    Peer("cvodes", 30.0),
    Peer("lsoda", 200.0),
    Peer("diffrax", 50.0),
    Peer("pathsim", 1000.0, 0.3),
)


UNMEASURED = {
    "openmodelica": "neither PyPI nor Debian has a package of OpenModelica's compiler, and its own "
    "installer is not part of the benchmark"
}
"""reasons why users' other choices have no figure"""


def others(par: MotorcycleParameters) -> Iterator[Result]:
    """Measure how much faster bywire is than each peer, and both errors."""
    exact = reference(par, hard_braking)
    for peer in PEERS:
        try:
            yield _compare(par, peer, exact)
        except Exception as error:  # any error that another library or version may raise
            yield failed(f"peer.{peer.name}", error, "times faster", f">= {peer.goal:g}")
    for name, reason in UNMEASURED.items():
        yield Result(f"peer.{name}", None, "times faster", note=f"not measured: {reason}")


def _compare(par: MotorcycleParameters, peer: Peer, exact: Solution) -> Result:
    module: ModuleType = importlib.import_module(f"benchmarks.motorcycle.{peer.name}")
    if not module.available():
        note = f"not installed: {INSTALL}"
        return Result(f"peer.{peer.name}", None, "times faster", f">= {peer.goal:g}", None, note)
    run = braking_run(par, hard_braking, peer.duration)
    own = simulate(run, ("p_mc",))
    before = _plain(run)
    solved = [
        (setting, module.solve(par, hard_braking, peer.duration, *setting))
        for setting in module.SETTINGS
    ]
    seconds = median((*before, *_plain(run)))
    own_error = error(Solution(own.time, own["p_mc"], 0.0), exact)
    errors = {setting: error(solution, exact) for setting, solution in solved}
    good = {setting: solution.seconds for setting, solution in solved if errors[setting] <= ERROR}
    if own_error > ERROR or not good:
        least = own_error if own_error > ERROR else min(errors.values())
        who = "bywire" if own_error > ERROR else peer.name
        raise ValueError(f"the error of {who} is {least:.4f} bar, but it must be <= {ERROR:g} bar")
    width, tolerance = min(good, key=lambda setting: good[setting])
    theirs, taken = errors[width, tolerance], good[width, tolerance]
    note = (
        f"{peer.duration:g} s; error <= {ERROR:g} bar: bywire {own_error:.4f} bar in "
        f"{1e3 * seconds:.2g} ms, {peer.name} {theirs:.4f} bar in {taken:.3g} s "
        f"(width {width:g} rad/s, tolerance {tolerance:g})"
    )
    return at_least(f"peer.{peer.name}", taken / seconds, peer.goal, "times faster", note)


def _plain(run: object) -> tuple[float, ...]:
    work = processor_timed(partial(simulate, run, ("p_mc",)))  # type: ignore[arg-type]
    return tuple(work() for _ in range(15))


PART = Part(
    "other simulators", lambda: others(cast(MotorcycleParameters, parameters("dardanelli2010")))
)
