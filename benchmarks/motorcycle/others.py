"""The same braking in other simulators that users would choose instead."""

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
from benchmarks.timing import timed
from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.core.catalog import parameters
from bywire.core.libraries import how_to_install
from bywire.simulation.run import simulate


@dataclass(frozen=True)
class Peer:
    """A peer, the goal for bywire's speed relative to the peer, and the simulated time [s]."""

    name: str
    goal: float
    duration: float = 1.2


PEERS = (
    Peer("cvodes", 30.0),
    Peer("lsoda", 200.0),
    Peer("diffrax", 50.0),
    Peer("pathsim", 1000.0, 0.3),
)


def others(par: MotorcycleParameters) -> Iterator[Result]:
    """Measure how much faster bywire is than each peer, and both errors."""
    exact = reference(par, hard_braking)
    for peer in PEERS:
        try:
            yield _compare(par, peer, exact)
        except Exception as error:  # any error that another library or version may raise
            yield failed(f"peer.{peer.name}", error, "times faster", f">= {peer.goal:g}")


def _compare(par: MotorcycleParameters, peer: Peer, exact: Solution) -> Result:
    module: ModuleType = importlib.import_module(f"benchmarks.motorcycle.{peer.name}")
    if not module.available():
        note = f"not installed: {how_to_install('benchmark')}"
        return Result(f"peer.{peer.name}", None, "times faster", f">= {peer.goal:g}", None, note)
    run = braking_run(par, hard_braking, peer.duration)
    own = simulate(run, ("p_mc",))
    before = _plain(run)
    solution = module.solve(par, hard_braking, peer.duration)
    seconds = median((*before, *_plain(run)))
    own_error = error(Solution(own.time, own["p_mc"], 0.0), exact)
    peer_error = error(solution, exact)
    note = f"errors: bywire {own_error:.4f} bar, {peer.name} {peer_error:.4f} bar"
    if peer_error < own_error:
        note += "; the peer is more accurate here"
    return at_least(
        f"peer.{peer.name}", solution.seconds / seconds, peer.goal, "times faster", note
    )


def _plain(run: object) -> tuple[float, ...]:
    work = timed(partial(simulate, run, ("p_mc",)))  # type: ignore[arg-type]
    return tuple(work() for _ in range(15))


PART = Part(
    "other simulators", lambda: others(cast(MotorcycleParameters, parameters("dardanelli2010")))
)
