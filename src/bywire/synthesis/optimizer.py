r"""Gains that keep the worst normalized slack as large as possible.

.. math:: \max_{x, t} t \quad \text{with} \quad s_{jk}(x) \ge t

for every requirement j and model k: the largest of smallest slacks, without the kinks that a
plain minimum has. Sequential quadratic programming from several starts, then a simplex where it
stopped at a kink of a figure itself.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.optimize import minimize
from scipy.stats import qmc

from bywire.bench.requirements import Limit
from bywire.core.typing import Array, Progress
from bywire.synthesis.linear_case import LinearCase, room, slack

Report = Callable[[float], None]
"""``report(share)``: the share of a stage that is done, 0 to 1"""


def stage(progress: Progress | None, label: str) -> Report:
    """Return what reports the share of one stage; nothing is shown where nobody watches."""
    if progress is None:
        return lambda share: None
    return lambda share: progress(label, min(max(share, 0.0), 1.0))


def piece(report: Report, k: int, count: int) -> Report:
    """Return what reports the share of one of several pieces of a stage."""
    return lambda share: report((k + share) / count)


def suffixed(progress: Progress | None, text: str) -> Progress | None:
    """Return progress whose labels say besides what they are of."""
    if progress is None:
        return None
    return lambda label, share: progress(f"{label}, {text}", share)


# --- The optimizer

UNSTABLE = -12.0
"""slack of an unstable loop, before its growth is counted"""
_LEAST, _LARGEST = -10.0, 3.0  # slacks beyond do not count as worse or better
KEPT_MISSED = -1e3
"""below this, a search has found nothing that meets the requirements to keep"""
_STEP = 1e-5  # of differences, share of a range
_SAMPLES, _STARTS = 64, 3
_ITERATIONS = 40
_SIMPLEX = 25  # evaluations per gain


@dataclass(frozen=True)
class Problem:
    """What is chosen, for what, and what it must serve.

    Parameters
    ----------
    tunables
        Dotted name -> lowest and highest value [SI]; searched on a logarithmic scale where the
        lowest is above zero.
    requirements
        What must hold for every case.
    cases
        The models, the nominal one first.
    """

    tunables: Mapping[str, tuple[float, float]]
    requirements: tuple[Limit, ...]
    cases: tuple[LinearCase, ...]
    _known: dict[tuple[bytes, int], tuple[Array, Array]] = field(default_factory=dict, repr=False)

    @property
    def evaluations(self) -> int:
        """Loops that were computed so far."""
        return len(self._known)

    def gains(self, z: Array) -> dict[str, float]:
        """Return gains by name for a point of the unit cube."""
        values = {}
        for share, (name, (low, high)) in zip(z, self.tunables.items(), strict=True):
            s = min(max(float(share), 0.0), 1.0)
            values[name] = low * (high / low) ** s if low > 0 else low + (high - low) * s
        return values

    def point(self, gains: Mapping[str, float]) -> Array:
        """Return the point of the unit cube for gains, the nearest where they lie outside."""
        shares = []
        for name, (low, high) in self.tunables.items():
            value = min(max(gains[name], low), high)
            share = math.log(value / low, high / low) if low > 0 else (value - low) / (high - low)
            shares.append(share)
        return np.array(shares)

    def slacks(self, z: Array, cases: Sequence[int], *, plain: bool = False) -> Array:
        """Return the slack of every requirement for some cases, shape (cases, requirements).

        ``plain``: a bandwidth by its frequency, see `linear_case.room`.
        """
        return np.array([self._of(z, k)[int(plain)] for k in cases])

    def points_seen(self, cases: Sequence[int]) -> list[Array]:
        """Return all points that were computed for every one of some cases."""
        keys = [{z for z, k in self._known if k == case} for case in cases]
        return [np.frombuffer(z) for z in sorted(set.intersection(*keys))]

    def _of(self, z: Array, k: int) -> tuple[Array, Array]:
        key = (np.round(z, 12).tobytes(), k)
        if key not in self._known:
            figures = self.cases[k].figures(self.gains(z))
            if figures.is_stable:
                both = [
                    [slack(figures, wanted) for wanted in self.requirements],
                    [room(figures, wanted) for wanted in self.requirements],
                ]
                slacks, rooms = np.clip(both, _LEAST, _LARGEST)
            else:
                worse = UNSTABLE - 10.0 * (figures.growth - 1.0)
                slacks = rooms = np.full(len(self.requirements), worse)
            self._known[key] = slacks, rooms
        return self._known[key]


@dataclass
class Search:
    """A search for the largest worst slack.

    Parameters
    ----------
    problem
        What is searched.
    cases
        Models that count.
    wanted
        Requirements whose worst slack grows; all by default.
    kept
        Requirements that must hold meanwhile.
    best, slack
        Best point found so far and its worst slack, also after an interrupt.
    seen
        Slack and place of every point that was looked at.
    plain
        Whether a bandwidth counts by its frequency: where requirements cannot be met, the room of
        the magnitude up to the limit says nothing of how far the frequency itself can go.
    """

    problem: Problem
    cases: Sequence[int]
    wanted: Sequence[int] | None = None
    kept: Sequence[int] = ()
    best: Array | None = None
    slack: float = -math.inf
    seen: list[tuple[float, Array]] = field(default_factory=list)
    plain: bool = False

    def recall(self) -> Array | None:
        """Return the best of all points that any search over these cases has seen."""
        for z in self.problem.points_seen(self.cases):
            self._judged(z)
        return self.best

    def run(self, starts: Sequence[Array], report: Report = lambda share: None) -> None:
        """Climb from each start, then from the best with a simplex and once more.

        Parameters
        ----------
        starts
            Points of the unit cube.
        report
            Called with the share that is done, at every iteration.
        """
        parts = len(starts) + 2
        for k, start in enumerate(starts):
            self._climb(start, piece(report, k, parts))
        if self.best is None:
            report(1.0)
            return
        # A figure such as an overshoot has kinks of its own: SQP stops there, a simplex goes on.
        n = self.best.size
        corners = np.vstack(
            [self.best, self.best + 0.04 * np.where(self.best < 0.5, 1, -1) * np.eye(n)]
        )
        options: Any = {"maxfev": _SIMPLEX * n, "initial_simplex": corners, "fatol": 1e-5}
        climb: Any = minimize  # its stubs tell the methods' starting points apart
        known, simplex = len(self.seen), piece(report, len(starts), parts)
        climb(
            lambda z: -self._judged(z),
            self.best,
            method="Nelder-Mead",
            bounds=[(0.0, 1.0)] * n,
            options=options,
            callback=lambda z: simplex((len(self.seen) - known) / (_SIMPLEX * n)),
        )
        self._climb(self.best, piece(report, len(starts) + 1, parts))
        report(1.0)

    def _chosen(self) -> list[int]:
        count = len(self.problem.requirements)
        return list(range(count)) if self.wanted is None else list(self.wanted)

    def _slacks(self, z: Array) -> Array:
        return self.problem.slacks(np.clip(z, 0.0, 1.0), self.cases, plain=self.plain)

    def _judged(self, z: Array) -> float:
        """Return the worst wanted slack, or what is missing of the kept ones; note the best."""
        slacks = self._slacks(z)
        value = float(slacks[:, self._chosen()].min())
        if self.kept:
            missing = float(slacks[:, list(self.kept)].min())
            if missing < -1e-6:
                value = KEPT_MISSED + missing
        self.seen.append((value, np.clip(z, 0.0, 1.0)))
        if value > self.slack:
            self.slack, self.best = self.seen[-1]
        return value

    def _climb(self, start: Array, report: Report) -> None:
        n, count = start.size, [0]

        def passed(_: Array) -> None:
            count[0] += 1
            report(count[0] / _ITERATIONS)

        def excess(v: Array) -> Array:
            self._judged(v[:n])
            slacks = self._slacks(v[:n])
            wanted = slacks[:, self._chosen()] - v[n]
            return np.concatenate([wanted.ravel(), slacks[:, list(self.kept)].ravel()])

        # Forward differences of our own: one loop per gain serves all requirements at once.
        def slope(v: Array) -> Array:
            here, columns = excess(v), []
            for k in range(n):
                h = _STEP if v[k] < 0.5 else -_STEP
                moved = v.copy()
                moved[k] += h
                columns.append((excess(moved) - here) / h)
            rate = np.zeros(here.size)
            rate[: len(self.cases) * len(self._chosen())] = -1.0
            return np.column_stack([*columns, rate])

        # The slack is a variable of its own (epigraph): smallest slacks have kinks, these do not.
        first = self._slacks(start)[:, self._chosen()].min()
        constraints: Any = [{"type": "ineq", "fun": excess, "jac": slope}]
        options: Any = {"maxiter": _ITERATIONS, "ftol": 1e-5}
        climb: Any = minimize
        climb(
            lambda v: -float(v[n]),
            np.append(start, max(first, UNSTABLE)),
            method="SLSQP",
            jac=lambda v: np.append(np.zeros(n), -1.0),
            bounds=[*[(0.0, 1.0)] * n, (None, None)],
            constraints=constraints,
            options=options,
            callback=passed,
        )
        report(1.0)


def starts_of(problem: Problem, given: Sequence[Array], seed: int) -> list[Array]:
    """Return where to start: the given points, and the best of a seeded sample of the cube."""
    n = len(problem.tunables)
    sample = qmc.Sobol(n, rng=np.random.default_rng(seed)).random(_SAMPLES)
    worst = [float(problem.slacks(z, [0]).min()) for z in sample]
    order = np.argsort(worst)[::-1]
    return [*given, *(sample[k] for k in order[:_STARTS])]
