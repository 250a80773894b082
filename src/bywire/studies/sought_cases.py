"""Cases of search designs: rare failures, and the worst case within ranges.

A search is replayed from its seed each time, including for a report. Its requests depend only on
the seed and on earlier results, so it requests the same cases again and finds them in the folder.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from bywire.bench.requirements import Limit
from bywire.core.callers import option
from bywire.core.errors import FileError
from bywire.core.typing import Array, Progress, silent
from bywire.studies.designs import SUBSET, SoughtDesign, population
from bywire.studies.distribution import Distribution
from bywire.studies.executor import Compute, Executor
from bywire.studies.limit_state import (
    BudgetSpentError,
    Margins,
    UnfinishedError,
    importance_sampling,
    margins_of,
    subset_simulation,
)
from bywire.studies.plan import CHUNK, StudyPlan
from bywire.studies.statistics import FailureProbability
from bywire.studies.store import CASE, Columns, PlacedChunk, StudyStore

if TYPE_CHECKING:
    import pandas as pd
    from scipy.optimize import OptimizeResult


@dataclass
class SoughtCases:
    """The cases of a search design.

    Parameters
    ----------
    plan, store
        The study and its folder.
    executor
        Executor of missing cases; None to compute nothing.
    progress
        Called with a label and the used fraction of the budget.
    """

    plan: StudyPlan
    store: StudyStore
    executor: Executor | None
    progress: Progress
    chunks: dict[int, Columns] = field(default_factory=dict)
    _shared: dict[bytes, list[int]] = field(default_factory=dict)
    _opened: ExitStack = field(default_factory=ExitStack)
    _compute: Compute | None = None

    def __enter__(self) -> SoughtCases:
        return self

    def __exit__(self, *error: Any) -> None:
        self._opened.__exit__(*error)  # the caller explains the loss of workers

    @property
    def design(self) -> SoughtDesign:
        """Budget and numbering of the search."""
        assert self.plan.sought is not None
        return self.plan.sought

    @property
    def frame(self) -> pd.DataFrame:
        """All cases, in the order of their numbers."""
        import pandas as pd

        frames = [pd.DataFrame(self.chunks[number]) for number in sorted(self.chunks)]
        return pd.concat(frames, ignore_index=True) if frames else pd.DataFrame()

    def batch(self, scores: Array, numbers: list[int]) -> list[int]:
        """Compute the missing cases at some scores, and return the chunks of all cases.

        Parameters
        ----------
        scores
            Shape (cases, quantities).
        numbers
            Numbers of their chunks. A batch with the scores of an earlier batch is not recomputed.

        Raises
        ------
        UnfinishedError
            If cases are missing, and there is no executor.
        FileError
            If the folder contains other cases in their place.
        """
        numbers = self._shared.setdefault(scores.tobytes(), numbers)
        wanted = {
            number: self.plan.values_at(scores[k * CHUNK : (k + 1) * CHUNK])
            for k, number in enumerate(numbers)
        }
        there = self.store.finished()
        missing = [PlacedChunk(n, values) for n, values in wanted.items() if n not in there]
        if missing:
            self._computed(missing)
        for number, values in wanted.items():
            if number not in self.chunks:
                self.chunks[number] = self.store.columns(number)
                self._require(number, values)
        return numbers

    def _computed(self, missing: list[PlacedChunk]) -> None:
        if self.executor is None:
            raise UnfinishedError
        if self._compute is None:  # start workers once, and only if needed
            self._compute = self._opened.enter_context(self.executor.opened(self.plan))
        for number, columns in self._compute(missing):
            self.store.write(number, columns, self.plan.column_units)

    def _require(self, number: int, values: Mapping[str, NDArray[np.generic]]) -> None:
        """Reject a chunk of other cases, whose results the search never requested."""
        found = self.chunks[number]
        for name, column in values.items():
            known = found.get(name, np.array([]))
            is_same = known.shape == column.shape and (
                bool(np.all(known == column))
                if column.dtype.kind in "OU"
                else np.allclose(known.astype(float), column, rtol=1e-9, atol=0.0)
            )
            if not is_same:
                raise FileError(
                    f"{self.store.path(number)} contains cases that this study does not request, "
                    "because another machine or library version draws differently. Choose another "
                    f"folder with {option('out')}",
                    name=str(self.store.path(number)),
                )


@dataclass
class RequirementCases:
    """The requested cases of a requirement, in order.

    Parameters
    ----------
    cases
        Cases of the study.
    requirement
        Number of the requirement among the judged ones.
    numbers, failed
        Numbers of the cases in the order of the requests, and numbers of the failed cases.
    """

    cases: SoughtCases
    requirement: int
    numbers: list[int] = field(default_factory=list)
    failed: set[int] = field(default_factory=set)
    _searched: int = 0
    _drawn: int = 0
    _said: str = ""

    @property
    def demand(self) -> Limit:
        """The requirement."""
        return self.cases.plan.judged_demands[self.requirement]

    def drawn(self, scores: Array) -> Array:
        """Return margins of cases with their own noise; see `limit_state.Margins`."""
        first = self.cases.design.first_sampled + self._drawn
        margins, chunks = self._margins(scores, first)
        self._drawn += chunks
        return margins

    def searched(self, scores: Array) -> Array:
        """Return margins of cases with the noise of the bench; see `limit_state.Margins`."""
        if self._searched >= self.cases.design.first_sampled:
            raise BudgetSpentError
        margins, chunks = self._margins(scores, self._searched)
        self._searched += chunks
        return margins

    def report(self, estimate: float) -> None:
        """Record the current estimate of the probability of failure."""
        self._said = f", failure {estimate:.2g} so far"

    def _margins(self, scores: Array, first: int) -> tuple[Array, int]:
        plan, used = self.cases.plan, len(self.numbers)
        if used + len(scores) > plan.cases:
            raise BudgetSpentError
        self.cases.progress(f"{self.demand.figure}{self._said}", used / plan.cases)
        count = -(-len(scores) // CHUNK)
        own = [self.cases.design.chunk(self.requirement, first + k) for k in range(count)]
        found = [self.cases.chunks[n] for n in self.cases.batch(scores, own)]
        self.numbers += [int(n) for columns in found for n in columns[CASE]]
        values = np.concatenate([columns[self.demand.figure] for columns in found])
        margins = margins_of(values, self.demand)
        self.failed.update(np.array(self.numbers[used:])[margins <= 0.0].tolist())
        return margins, count


# --- The rare failures of a study

_NEGLIGIBLE = 1e-3  # of the allowed probability of failure: the verdict is clear


@dataclass(frozen=True)
class Importance:
    """Importance of a quantity for a failure.

    Parameters
    ----------
    quantity
        Its name.
    score
        Normal score of the failures: signed number of standard deviations from the middle; NaN for
        discrete values, which have no middle.
    factor
        Importance factor: fraction of the squared distance, 0 to 1. For discrete values, the
        squared distance is twice the relative entropy of failing cases to all cases, as for a
        shifted normal score.
    shares
        Fraction of each discrete value in the failing cases; empty for other quantities.
    """

    quantity: str
    score: float
    factor: float
    shares: Mapping[Any, float] = field(default_factory=dict)


@dataclass(frozen=True)
class RareFailure:
    """The failure of a requirement.

    Parameters
    ----------
    demand
        The requirement.
    failure
        Estimate of its probability.
    case
        Number of the most probable failing case that was computed; None if no case failed.
    importance
        Quantities, the most important first; empty if the location of failures is unknown.
    point
        Values of the varied quantities at failures [SI]: at the design point, or at the mean normal
        scores of failing cases, and the most frequent discrete value; empty if they are unknown.
    """

    demand: Limit
    failure: FailureProbability
    case: int | None
    importance: tuple[Importance, ...]
    point: Mapping[str, Any]


def rare_failures(
    plan: StudyPlan,
    store: StudyStore,
    executor: Executor | None = None,
    progress: Progress = silent,
) -> tuple[tuple[RareFailure, ...], pd.DataFrame]:
    """Return the rare failures of a study, and all of its cases.

    Parameters
    ----------
    plan, store
        The study and its folder.
    executor
        Executor of missing cases; None to evaluate existing ones.
    progress
        Called with a label and the used fraction of the budget.

    Raises
    ------
    FileError
        If OpenTURNS is not installed, or the folder is not readable or writable.
    RunError
        If workers are lost.
    KeyboardInterrupt
        If interrupted.
    """
    with SoughtCases(plan, store, executor, progress) as cases:
        failures = tuple(
            _failure(plan, RequirementCases(cases, k)) for k in range(len(plan.judged_demands))
        )
    return failures, cases.frame


def _failure(plan: StudyPlan, cases: RequirementCases) -> RareFailure:
    design, count = cases.cases.design, len(plan.varied)
    assert cases.demand.probability is not None
    if design.kind == SUBSET:
        negligible = _NEGLIGIBLE * (1.0 - cases.demand.probability)
        failure = subset_simulation(
            cases.drawn, count, design.level, plan.seed, plan.confidence, negligible, cases.report
        )
    else:
        failure = importance_sampling(
            cases.drawn,
            cases.searched,
            count,
            plan.cases,
            plan.seed,
            plan.confidence,
            CHUNK,
            cases.report,
        )
    # A point that was requested twice, for example for derivatives, is the same case.
    failure = replace(failure, runs=len({*cases.numbers}), failed=len(cases.failed))
    case = None if failure.place is None else cases.numbers[failure.place]
    importance = importance_of(plan, failure)
    point = {}
    if importance and failure.center is not None:
        values = plan.values_at(np.asarray(failure.center)[None, :])
        point = {name: column[0].item() for name, column in values.items()}
        point |= {
            i.quantity: max(i.shares, key=i.shares.__getitem__) for i in importance if i.shares
        }
    return RareFailure(cases.demand, failure, case, importance, point)


def importance_of(plan: StudyPlan, failure: FailureProbability) -> tuple[Importance, ...]:
    """Return importance factors of Hasofer and Lind's design point, or of the mean failure.

    For correlated quantities, they refer to each quantity's own normal scores.
    """
    is_rare = failure.estimate.value < 0.5  # otherwise failures are everywhere
    if failure.center is None or not is_rare:
        return ()
    moved = plan.scored.correlated(failure.center)
    squares, scores = moved**2, moved.tolist()
    shares: list[dict[Any, float]] = [{} for _ in scores]
    if failure.failing is not None:
        for k, each in enumerate(plan.varied):
            if each.distribution.is_discrete:
                column = plan.values_at(failure.failing)[each.name].tolist()
                count = Counter(column)
                shares[k] = {x: count[x] / len(column) for x in each.distribution.singles}
                squares[k], scores[k] = 2.0 * _entropy(shares[k], each.distribution), math.nan
    if not squares.sum() > 0.0:
        return ()
    found = [
        Importance(v.name, float(score), float(square / squares.sum()), share)
        for v, score, square, share in zip(plan.varied, scores, squares, shares, strict=True)
    ]
    return tuple(sorted(found, key=lambda i: -i.factor))


def _entropy(shares: Mapping[Any, float], distribution: Distribution) -> float:
    """Return the relative entropy of fractions of discrete values to their probabilities."""
    return sum(
        p * math.log(p / weight)
        for p, weight in zip(shares.values(), distribution.weights, strict=True)
        if p > 0.0
    )


# --- Worst cases: searches, which do not prove that a case is the worst

_BEYOND_ENDS = 0.1  # of a range: worst cases are often at the ends, which get extra probability
_WORST = -1e12  # margin of a case without a figure: the worst, but finite for means
_GENERATIONS = 10_000
_TOGETHER = 1e-2  # fraction of the first generation's spread at which a generation has converged


@dataclass(frozen=True)
class WorstCase:
    """Result of a search for the worst case.

    Parameters
    ----------
    state
        ``done``: it converged; ``budget spent``; ``unfinished``: cases are not computed yet.
    margin
        Minimum margin, in the figure's unit; infinite without a case.
    runs
        Number of cases used.
    """

    state: Literal["done", "budget spent", "unfinished"]
    margin: float
    runs: int


def worst_case(margins: Margins, quantities: int, seed: int) -> WorstCase:
    """Search for the minimum margin by differential evolution, with SciPy.

    Parameters
    ----------
    margins
        Margins of a batch of points of the unit cube, shape (cases, quantities).
    quantities
        Number of quantities.
    seed
        Seed of the random numbers.

    References
    ----------
    R. Storn and K. Price, Differential evolution, Journal of Global Optimization 11, 1997.
    """
    from scipy import optimize  # both slow to load
    from scipy.stats import qmc

    tried: list[Array] = []

    def batch(columns: Array) -> Array:
        # Columns are the points of a generation; points beyond an end are moved to it.
        points = np.clip(columns.T, 0.0, 1.0)
        tried.append(np.maximum(margins(points), _WORST))
        return tried[-1]

    def is_over(intermediate_result: OptimizeResult) -> bool:
        energies: Array = intermediate_result.population_energies
        return bool(np.ptp(energies) <= _TOGETHER * np.ptp(tried[0]))

    rng = np.random.default_rng(seed)
    half = population(quantities) // 2  # corners; all of them for few quantities
    corners = qmc.Sobol(quantities, rng=rng).random(half).round()
    first = np.vstack([corners, qmc.LatinHypercube(quantities, rng=rng).random(half)])
    low, high = -_BEYOND_ENDS, 1.0 + _BEYOND_ENDS
    state: Literal["done", "budget spent", "unfinished"] = "done"
    try:
        # SciPy's own criterion ends a search if margins are large relative to their spread.
        search: Any = optimize.differential_evolution
        search(
            batch,
            [(low, high)] * quantities,
            init=low + (high - low) * first,
            rng=rng,
            tol=0.0,
            maxiter=_GENERATIONS,
            polish=False,
            updating="deferred",
            vectorized=True,
            strategy="rand1bin",
            callback=is_over,  # the best point alone would attract all points to one end
        )
    except BudgetSpentError:
        state = "budget spent"
    except UnfinishedError:
        state = "unfinished"
    least = min((float(each.min()) for each in tried), default=np.inf)
    return WorstCase(state, least, sum(map(len, tried)))


# --- One search for each requirement


def worst_cases(
    plan: StudyPlan,
    store: StudyStore,
    executor: Executor | None = None,
    progress: Progress = silent,
) -> tuple[tuple[WorstCase, ...], pd.DataFrame]:
    """Return the results of the search for each requirement's worst case, and all cases.

    Parameters
    ----------
    plan, store
        The study and its folder.
    executor
        Executor of missing cases; None to evaluate existing ones.
    progress
        Called with a label and the used fraction of the budget.

    Raises
    ------
    FileError
        If the folder is not readable or writable.
    RunError
        If workers are lost.
    KeyboardInterrupt
        If interrupted.
    """
    with SoughtCases(plan, store, executor, progress) as cases:
        found = tuple(
            worst_case(RequirementCases(cases, k).drawn, len(plan.varied), plan.seed)
            for k in range(len(plan.judged_demands))
        )
    return found, cases.frame
