"""All free parameters from all statements at once: several starts, and what is told held apart."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from bywire.brakes.motorcycle.paper.measured.misfit import (
    LOSS,
    Appraisal,
    appraised,
    problem,
    sized,
)
from bywire.brakes.motorcycle.paper.measured.unknowns import brake, unknowns
from bywire.core.typing import Array, Progress
from bywire.identification.estimate import Estimate
from bywire.identification.least_squares import estimate, solve
from bywire.identification.multistart import search
from bywire.identification.unknown import moved, scattered

SPREAD = 0.3
"""how far from Table 1 the other starts are, at most, as a share of it"""

_ROUNDS = 6  # of holding and searching: two were enough


def estimated(
    starts: int = 6, seed: int = 1, *, progress: Progress | None = None, store: Path | None = None
) -> Estimate:
    """Return the free parameters that explain the statements best.

    From where the best start led, what is told least goes back to Table 1 and the rest is searched
    on, until all is told; from there everything is free once more, and then `settled`. What the
    statements do not tell is kept at Table 1 and named with the reason.

    Parameters
    ----------
    starts
        Table 1, then others around it.
    seed
        Of their random numbers.
    progress
        Called with a label and the finished share.
    store
        File that keeps every finished start.

    Returns
    -------
    Estimate
        Values [SI] with covariance; residuals in tolerances, in the order of `STATEMENTS`.

    Raises
    ------
    SolverError
        When no start led anywhere.
    """
    begin = scattered(unknowns(), starts, SPREAD, seed)
    led = search(problem(), begin, LOSS, progress, store)
    first = estimate(problem(sized(led.best.values)), LOSS, led.best.values)
    table1 = {u.name: u.start for u in unknowns()}
    told = table1 | dict(zip(first.names, first.values.tolist(), strict=True))
    best = settled(searched(np.array([told[name] for name in table1]), ())).estimate
    return best.noted((f"{led.reached} of {starts} starts met the lowest minimum",))


def settled(values: Array) -> Appraisal:
    """Return the minimum near by at which nothing moves that the statements do not tell.

    They are asked what they do not tell there; that goes back to Table 1, and the rest is searched
    on. It ends where holding and searching agree: what is not told at the minimum is what was held.
    Where they turn in a circle, the lowest minimum of it counts.

    Parameters
    ----------
    values
        Of all free parameters, in the order of `unknowns`, SI.

    Raises
    ------
    SolverError
        When a trajectory leaves the numbers.
    """
    found: list[Appraisal] = []
    seen: list[tuple[int, ...]] = []
    for _ in range(_ROUNDS):
        here = appraised(brake(_named(values)))
        found.append(here)
        held = _untold(here)
        if held in seen:
            break
        seen.append(held)
        values = searched(values, held)
    return min(found[1:], key=lambda each: each.misfit)


def searched(values: Array, held: tuple[int, ...]) -> Array:
    """Return the minimum near by with some of the unknowns, by their index, at Table 1."""
    table1 = np.array([u.start for u in unknowns()])
    free = np.setdiff1d(np.arange(values.size), held)
    begin = np.where(np.isin(np.arange(values.size), held), table1, values)
    whole = problem(moved(sized(values), begin))
    for index in sorted(held, reverse=True):
        whole = whole.held(index)
    end = begin.copy()
    end[free] = solve(whole, begin[free], LOSS).values
    return end


def _untold(here: Appraisal) -> tuple[int, ...]:
    """Return the indices of what the statements do not tell."""
    names = [u.name for u in unknowns()]
    return tuple(sorted(names.index(kept.unknown.name) for kept in here.estimate.kept))


def _named(values: Array) -> dict[str, float]:
    return {u.name: float(v) for u, v in zip(unknowns(), values, strict=True)}
