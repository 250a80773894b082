"""Gains tuned on the nonlinear bench itself, where friction and dither change the loop.

Differential evolution of a library, every generation one ensemble: what the linear model cannot
know (friction under dither, converter, limits) is measured for every candidate.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import OptimizeResult, differential_evolution
from scipy.stats import qmc

from bywire.core.interrupts import interrupt_heard
from bywire.core.typing import Array, Progress
from bywire.synthesis.bench_figures import BenchFigures
from bywire.synthesis.candidate import Candidate, judged, linear_slacks
from bywire.synthesis.linear_case import NOMINAL
from bywire.synthesis.optimizer import Problem

Measure = Callable[[Mapping[str, Sequence[float]]], Sequence[Mapping[str, BenchFigures]]]

_ENOUGH = 0.02  # worst slack at which the search ends
_MEMBERS = 36
GENERATIONS = 60
"""of a search, at most"""
_REACH = 0.5  # of the linear ranges (logarithmic), around the linear design


@dataclass(frozen=True)
class Tuning:
    """Outcome of a tuning.

    Parameters
    ----------
    best
        The candidate with the largest worst slack; among those with enough of it, the one with
        the largest worst bandwidth, and where requirements are missed, the one whose figures
        are nearest.
    tried
        All candidates, in the order in which they ran.
    interrupted
        Whether the user ended it.
    untold
        Candidates that ran besides, judged by a part of the trials only.
    """

    best: Candidate
    tried: tuple[Candidate, ...]
    interrupted: bool
    untold: int = 0

    @property
    def count(self) -> int:
        """Candidates that ran."""
        return len(self.tried) + self.untold

    def curve(self, first: str, second: str) -> list[tuple[float, float]]:
        """Return the edge of what was reached in two figures while the rest was met.

        Parameters
        ----------
        first, second
            Texts of two requirements.

        Returns
        -------
        list of (float, float)
            Pairs of distances from the limits, none better in both than another, by the first.
        """
        pairs = sorted(
            ((c.room(first), c.room(second)) for c in self.tried
             if all(s >= 0.0 for text, s in c.slacks.items() if text not in (first, second))),
            reverse=True,
        )  # fmt: skip
        edge: list[tuple[float, float]] = []
        for room_1, room_2 in pairs:
            if not edge or room_2 > edge[-1][1]:
                edge.append((room_1, room_2))
        return edge[::-1]


def tune(
    problem: Problem,
    start: Mapping[str, float],
    measure: Measure,
    *,
    seed: int = 0,
    generations: int = GENERATIONS,
    progress: Progress | None = None,
) -> Tuning:
    """Search gains around a linear design that meet the requirements on the bench.

    Parameters
    ----------
    problem
        Requirements, tunables, and the linear models: all of them must stay stable.
    start
        The linear design's gains, one of the first generation.
    measure
        ``measure(gains) -> figures`` by label, for several sets at once.
    seed
        Of the search.
    generations
        At most; it ends when the worst slack is 2 %.
    progress
        Called with a label and the finished share.
    """
    center, n = problem.point(start), len(problem.tunables)
    low, high = np.clip(center - _REACH, 0.0, 1.0), np.clip(center + _REACH, 0.0, 1.0)
    first = low + (high - low) * qmc.LatinHypercube(n, rng=np.random.default_rng(seed)).random(
        _MEMBERS
    )
    first[0] = center  # the linear design itself: the search cannot end worse than it
    tried: list[Candidate] = []
    count = [0]

    def cost(points: Array) -> Array:
        rows = [problem.gains(z) for z in np.atleast_2d(points.T)]
        new = _candidates(problem, rows, measure)
        tried.extend(new)
        return -np.array([candidate.slack for candidate in new])

    def passed(intermediate_result: OptimizeResult) -> bool:
        count[0] += 1
        if progress is not None:
            progress("tuning on the bench", count[0] / generations)
        return bool(intermediate_result.fun <= -_ENOUGH)

    interrupted = False
    try:
        evolution: Any = differential_evolution  # its stubs know no cost of many points at once
        evolution(
            cost, list(zip(low, high, strict=True)), init=first, maxiter=generations,
            vectorized=True, updating="deferred", polish=False, tol=1e-6,
            rng=np.random.default_rng(seed), callback=passed,
        )  # fmt: skip
    except KeyboardInterrupt:
        interrupt_heard()
        interrupted = True
        if not tried:
            raise
    return Tuning(max(tried, key=standing), tuple(tried), interrupted)


def standing(candidate: Candidate) -> tuple[float, float]:
    """Return what a search prefers gains by, see `Candidate.standing`."""
    return candidate.standing(_ENOUGH)


def _candidates(
    problem: Problem, rows: Sequence[Mapping[str, float]], measure: Measure
) -> list[Candidate]:
    """Return candidates; those that a linear model says are unstable are not run."""
    linear = [linear_slacks(problem, row) for row in rows]
    alive = [k for k, slacks in enumerate(linear) if min(slacks.values()) > -10.0]
    nothing: Mapping[str, BenchFigures] = {NOMINAL: BenchFigures((), {})}
    figures = dict.fromkeys(range(len(rows)), nothing)
    if alive:
        names = rows[0].keys()
        measured = measure({name: [rows[k][name] for k in alive] for name in names})
        figures |= dict(zip(alive, measured, strict=True))
    return [
        judged(problem.requirements, row, figures[k], linear[k]) for k, row in enumerate(rows)
    ]
