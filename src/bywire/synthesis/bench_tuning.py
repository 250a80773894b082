"""Gains tuned on the nonlinear bench itself, where friction and dither change the loop.

Differential evolution of a library, every generation one ensemble: what the linear model cannot
know (friction under dither, converter, limits) is measured. The search takes up a candidate only
where its worst slack is not below that of the member whose place it would take. A worst slack is a
minimum, so whatever is measured first bounds it, the linear models' figures before all: candidates
whose bound is too low are measured no further, which changes no step of the search. Those that may
come near the best so far are measured in any case, for they make the edge that is shown.
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
from bywire.synthesis.candidate import Candidate, ceiling, judged, linear_slacks
from bywire.synthesis.linear_case import NOMINAL
from bywire.synthesis.optimizer import Problem

Worth = Callable[[int, Sequence[BenchFigures]], bool]
Measure = Callable[
    [Mapping[str, Sequence[float]], Worth], Sequence[Mapping[str, BenchFigures] | None]
]
"""``measure(gains, worth)``: figures by label of several sets, None of those that were left where
``worth(k, known figures)`` was false"""

_ENOUGH = 0.02  # worst slack at which the search ends
_NEAR = 0.03  # of the best worst slack: what is measured in full wherever the search stands
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
        All candidates that were measured in full, in the order in which they ran.
    interrupted
        Whether the user ended it.
    untold
        Candidates besides, judged by a part of the trials only.
    """

    best: Candidate
    tried: tuple[Candidate, ...]
    interrupted: bool
    untold: int = 0

    @property
    def count(self) -> int:
        """Candidates that were judged."""
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
            (
                (c.room(first), c.room(second))
                for c in self.tried
                if all(s >= 0.0 for text, s in c.slacks.items() if text not in (first, second))
            ),
            reverse=True,
        )
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
        See `Measure`.
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
    count, left = [0], [0]
    to_beat = np.full(_MEMBERS, -np.inf)

    def cost(points: Array) -> Array:
        rows = [problem.gains(z) for z in np.atleast_2d(points.T)]
        new = _candidates(problem, rows, measure, to_beat)
        tried.extend(each for each in new if isinstance(each, Candidate))
        left[0] += sum(isinstance(each, float) for each in new)
        return -np.array([each if isinstance(each, float) else each.slack for each in new])

    def passed(intermediate_result: OptimizeResult) -> bool:
        count[0] += 1
        if progress is not None:
            progress("tuning on the bench", count[0] / generations)
        members = -intermediate_result.population_energies
        to_beat[:] = np.minimum(members, members.max() - _NEAR)
        return bool(intermediate_result.fun <= -_ENOUGH)

    interrupted = False
    try:
        evolution: Any = differential_evolution  # its stubs know no cost of many points at once
        evolution(
            cost,
            list(zip(low, high, strict=True)),
            init=first,
            maxiter=generations,
            vectorized=True,
            updating="deferred",
            polish=False,
            tol=1e-6,
            rng=np.random.default_rng(seed),
            callback=passed,
        )
    except KeyboardInterrupt:
        interrupt_heard()
        interrupted = True
        if not tried:
            raise
    return Tuning(max(tried, key=standing), tuple(tried), interrupted, left[0])


def standing(candidate: Candidate) -> tuple[float, float]:
    """Return what a search prefers gains by, see `Candidate.standing`."""
    return candidate.standing(_ENOUGH)


def _candidates(
    problem: Problem,
    rows: Sequence[Mapping[str, float]],
    measure: Measure,
    to_beat: Array,
) -> list[Candidate | float]:
    """Return candidates, or what the slack of those that were left cannot exceed.

    Those that a linear model says are unstable are not run.

    Parameters
    ----------
    problem, measure
        As in `tune`.
    rows
        Gains of each candidate.
    to_beat
        Worst slack of each below which it is left.
    """
    linear = [linear_slacks(problem, row) for row in rows]
    bounds = [ceiling(problem.requirements, (), slacks) for slacks in linear]
    stable = [min(slacks.values()) > -10.0 for slacks in linear]
    tried = [k for k in range(len(rows)) if stable[k] and bounds[k] >= to_beat[k]]

    def worth(j: int, known: Sequence[BenchFigures]) -> bool:
        k = tried[j]
        bounds[k] = ceiling(problem.requirements, known, linear[k])
        return bool(bounds[k] >= to_beat[k])

    nothing: Mapping[str, BenchFigures] = {NOMINAL: BenchFigures((), {})}
    figures: dict[int, Mapping[str, BenchFigures] | None] = {
        k: nothing for k in range(len(rows)) if not stable[k]
    }
    if tried:
        sets = {name: [rows[k][name] for k in tried] for name in rows[0]}
        figures |= dict(zip(tried, measure(sets, worth), strict=True))
    candidates: list[Candidate | float] = []
    for k, row in enumerate(rows):
        known = figures.get(k)
        left = float(bounds[k])
        candidates.append(
            left if known is None else judged(problem.requirements, row, known, linear[k])
        )
    return candidates
