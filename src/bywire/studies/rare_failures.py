"""The rare failures of a study: how probable each is, and its most probable failing case."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from bywire.bench.requirements import Limit
from bywire.core.typing import Progress, silent
from bywire.studies.computing import Executor
from bywire.studies.distribution import Distribution
from bywire.studies.failure_probability import FailureProbability
from bywire.studies.importance_sampling import importance_sampling
from bywire.studies.plan import CHUNK, StudyPlan
from bywire.studies.sought_cases import RequirementCases, SoughtCases
from bywire.studies.sought_design import SUBSET
from bywire.studies.store import StudyStore
from bywire.studies.subset_simulation import subset_simulation

if TYPE_CHECKING:
    import pandas as pd

_NEGLIGIBLE = 1e-3  # of the probability of failure that is admitted: the verdict is clear


@dataclass(frozen=True)
class Importance:
    """How much a quantity has to do with a failure.

    Parameters
    ----------
    quantity
        Its name.
    score
        Normal score of where failures lie: standard deviations off the middle, with their sign; NaN
        of single values, which have no middle.
    factor
        Importance factor: share of the squared distance, 0 to 1. That of single values is twice the
        relative entropy of failing cases to all, as it is of a normal score that is moved.
    shares
        Share of failing cases that has each single value; empty of other quantities.
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
        How probable its failure is.
    case
        Number of the most probable failing case that was computed; None where none failed.
    importance
        Quantities, the most important first; none where it is not known where failures lie.
    point
        Values of what varies where failures lie [SI]: at the design point, or at the mean normal
        scores of failing cases, and of single values the most frequent one; empty where that is not
        known.
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
        Who computes the cases that the folder lacks; None to say what it shows so far.
    progress
        Called with a label and the share of the budget that is used.

    Raises
    ------
    FileError
        When OpenTURNS is not installed, or the folder cannot be read or written.
    RunError
        When workers are lost.
    KeyboardInterrupt
        When interrupted.
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
    # Points that were asked for again, as by derivatives at the same place, are the same cases.
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
    """Return importance factors: those of Hasofer and Lind's design point, or of the mean failure.

    Of correlated quantities they are of their own normal scores.
    """
    is_rare = failure.estimate.value < 0.5  # else failures lie everywhere
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
    """Return the relative entropy of shares of single values to their probabilities."""
    return sum(
        p * math.log(p / weight)
        for p, weight in zip(shares.values(), distribution.weights, strict=True)
        if p > 0.0
    )
