"""The worst cases within the ends of what varies: searches, which prove nothing."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from bywire.core.typing import Array, Progress, silent
from bywire.studies.designs import population
from bywire.studies.executor import Executor
from bywire.studies.limit_state import BudgetSpentError, Margins, UnfinishedError
from bywire.studies.plan import StudyPlan
from bywire.studies.rare_failures import RequirementCases, SoughtCases
from bywire.studies.store import StudyStore

if TYPE_CHECKING:
    import pandas as pd
    from scipy.optimize import OptimizeResult

_BEYOND_ENDS = 0.1  # of a range: worst cases lie at ends, which then have a share of their own
_WORST = -1e12  # margin of a case without a figure: the worst, and one that has a mean
_GENERATIONS = 10_000
_TOGETHER = 1e-2  # share of the first generation's spread within which a generation is at one place


@dataclass(frozen=True)
class WorstCase:
    """How a search for the worst case ended.

    Parameters
    ----------
    state
        ``done``: all of its cases came together; ``budget spent``; ``unfinished``: cases are not
        computed yet.
    margin
        Least margin that was found, in the figure's unit; infinite without a case.
    runs
        Cases used.
    """

    state: Literal["done", "budget spent", "unfinished"]
    margin: float
    runs: int


def worst_case(margins: Margins, quantities: int, seed: int) -> WorstCase:
    """Search for the least margin by differential evolution, with SciPy.

    Parameters
    ----------
    margins
        Margins of a batch of points of the unit cube, shape (cases, quantities).
    quantities
        How many there are.
    seed
        Of the random numbers.

    References
    ----------
    R. Storn and K. Price, Differential evolution, Journal of Global Optimization 11, 1997.
    """
    from scipy import optimize  # slow to load, both
    from scipy.stats import qmc

    tried: list[Array] = []

    def batch(columns: Array) -> Array:
        # Of all at once, a column each; what lies beyond an end is the end.
        points = np.clip(columns.T, 0.0, 1.0)
        tried.append(np.maximum(margins(points), _WORST))
        return tried[-1]

    def is_over(intermediate_result: OptimizeResult) -> bool:
        energies: Array = intermediate_result.population_energies
        return bool(np.ptp(energies) <= _TOGETHER * np.ptp(tried[0]))

    rng = np.random.default_rng(seed)
    half = population(quantities) // 2  # corners; all of them of few quantities
    corners = qmc.Sobol(quantities, rng=rng).random(half).round()
    first = np.vstack([corners, qmc.LatinHypercube(quantities, rng=rng).random(half)])
    low, high = -_BEYOND_ENDS, 1.0 + _BEYOND_ENDS
    state: Literal["done", "budget spent", "unfinished"] = "done"
    try:
        # Its own rule ends where margins differ little beside their mean: far from any limit.
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
            callback=is_over,  # the best of all would draw them to one end
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
    """Return how the search for the worst case of each requirement ended, and all cases.

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
        When the folder cannot be read or written.
    RunError
        When workers are lost.
    KeyboardInterrupt
        When interrupted.
    """
    with SoughtCases(plan, store, executor, progress) as cases:
        found = tuple(
            worst_case(RequirementCases(cases, k).drawn, len(plan.varied), plan.seed)
            for k in range(len(plan.judged_demands))
        )
    return found, cases.frame
