"""Gains tuned on the nonlinear bench itself, where friction and dither change the loop.

Differential evolution of a library, every generation one ensemble: what the linear model cannot
know (friction under dither, converter, limits) is measured for every candidate.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import OptimizeResult, differential_evolution
from scipy.stats import qmc

from bywire.analysis.design.bench_figures import STEP_FIGURES, BenchFigures
from bywire.analysis.design.optimizer import Problem, Progress
from bywire.analysis.design.requirement import Requirement

Array = NDArray[np.float64]
Measure = Callable[[Mapping[str, Sequence[float]]], Sequence[BenchFigures]]

STEADY = 0.05
"""mean error that counts as none where zero is required [% of the step]; converters round"""
_ENOUGH = 0.02  # worst slack at which the search ends
_LEAST = -3.0
_MEMBERS = 36
GENERATIONS = 60
"""of a search, at most"""
_REACH = 0.5  # of the linear ranges (logarithmic), around the linear design


@dataclass(frozen=True)
class Candidate:
    """A set of gains with what it showed.

    Parameters
    ----------
    gains
        By dotted name [SI].
    figures
        On the bench.
    slacks
        By requirement's text: share of the limit, worst amplitude.
    """

    gains: Mapping[str, float]
    figures: BenchFigures
    slacks: Mapping[str, float]

    @property
    def slack(self) -> float:
        """The worst slack."""
        return min(self.slacks.values())


@dataclass(frozen=True)
class Tuning:
    """Outcome of a tuning.

    Parameters
    ----------
    best
        The candidate with the largest worst slack.
    tried
        All candidates, in the order in which they ran.
    interrupted
        Whether the user ended it.
    """

    best: Candidate
    tried: tuple[Candidate, ...]
    interrupted: bool

    def curve(self, one: str, other: str) -> list[tuple[float, float]]:
        """Return the edge of what was reached in two slacks while the rest was met.

        Parameters
        ----------
        one, other
            Texts of two requirements.

        Returns
        -------
        list of (float, float)
            Pairs of slacks, none better in both than another, sorted by the first.
        """
        pairs = sorted(
            ((c.slacks[one], c.slacks[other]) for c in self.tried
             if all(s >= 0.0 for text, s in c.slacks.items() if text not in (one, other))),
            reverse=True,
        )  # fmt: skip
        edge: list[tuple[float, float]] = []
        for first, second in pairs:
            if not edge or second > edge[-1][1]:
                edge.append((first, second))
        return edge[::-1]


def bench_slacks(
    requirements: Sequence[Requirement], found: BenchFigures, linear: Mapping[str, float]
) -> dict[str, float]:
    """Return how far each requirement is met on the bench.

    Bandwidth counts at the worst amplitude, by the room of the gain above -3 dB; a phase margin
    in the linear model (what large motion comes near) and in each describing function; figures
    of the step where the experiment has one; the rest is the linear model's alone.

    Parameters
    ----------
    requirements
        What is required.
    found
        Figures on the bench.
    linear
        Slack in the linear models by requirement's text.
    """
    slacks = {}
    for one in requirements:
        slack = _on_bench(one, found)
        if math.isinf(slack) or one.figure == "phase_margin":
            slack = min(slack, linear[one.text])
        slacks[one.text] = max(slack, _LEAST)
    return slacks


def _on_bench(one: Requirement, found: BenchFigures) -> float:
    """Return the slack of what the bench measures; infinity for what it does not."""
    if one.figure == "bandwidth" and one.sense > 0:
        return min((s.least / math.sqrt(0.5) - 1.0 for s in found.small), default=math.inf)
    if one.figure == "phase_margin":
        seen = [s for s in found.small if not math.isnan(s.crossover)]
        return min((one.slack(s.phase_margin) for s in seen), default=math.inf)
    if one.figure in ("bandwidth", "crossover"):
        values = [getattr(s, one.figure) for s in found.small]
        return min((one.slack(v) for v in values if not math.isnan(v)), default=math.inf)
    if one.figure not in STEP_FIGURES or not found.step:
        return math.inf
    value = found.step[one.figure]
    if one.figure == "steady_state_error" and one.limit == 0.0 and not math.isnan(value):
        return (STEADY - value) / STEADY
    return one.slack(value)


def linear_slacks(problem: Problem, gains: Mapping[str, float]) -> dict[str, float]:
    """Return the slack of every requirement for the worst model, by its text."""
    slacks = problem.slacks(problem.point(gains), range(len(problem.cases))).min(axis=0)
    return {one.text: float(s) for one, s in zip(problem.requirements, slacks, strict=True)}


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
        ``measure(gains) -> figures`` of several sets at once.
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
    first[0] = center
    tried: list[Candidate] = []
    count = [0]

    def cost(points: Array) -> Array:
        rows = [problem.gains(z) for z in np.atleast_2d(points.T)]
        new = _candidates(problem, rows, measure)
        tried.extend(new)
        return -np.array([one.slack for one in new])

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
        interrupted = True
        if not tried:
            raise
    return Tuning(max(tried, key=lambda one: one.slack), tuple(tried), interrupted)


def _candidates(
    problem: Problem, rows: Sequence[Mapping[str, float]], measure: Measure
) -> list[Candidate]:
    """Return candidates; those that a linear model says are unstable are not run."""
    linear = [linear_slacks(problem, row) for row in rows]
    alive = [k for k, one in enumerate(linear) if min(one.values()) > -10.0]
    nothing = BenchFigures((), {})
    found = dict.fromkeys(range(len(rows)), nothing)
    if alive:
        names = rows[0].keys()
        measured = measure({name: [rows[k][name] for k in alive] for name in names})
        found |= dict(zip(alive, measured, strict=True))
    return [
        Candidate(row, found[k], bench_slacks(problem.requirements, found[k], linear[k]))
        for k, row in enumerate(rows)
    ]  # fmt: skip
