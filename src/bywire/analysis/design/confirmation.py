"""The best points of a search, looked at anew on a finer grid of frequencies."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from bywire.analysis.design.optimizer import KEPT_MISSED, UNSTABLE, Problem, Search
from bywire.analysis.design.requirement import Requirement

Array = NDArray[np.float64]

_CONFIRMED, _ALIKE = 40, 1e-3  # points looked at anew, and how far apart
_CONFIRMED_FIGURES, _APART = 150, 1e-2  # the same where a figure itself is searched


def confirmed(search: Search, points: int) -> Array:
    """Return the best point on a finer grid of frequencies, all models counted.

    A coarse grid may step over a narrow dip of the closed loop to -3 dB: the best points lie
    where figures jump.
    """
    problem = search.problem
    best, found = -math.inf, np.asarray(search.best)
    tried: list[Array] = []
    for slack, z in sorted(search.seen, key=lambda one: -one[0]):
        if slack <= best + 1e-4 or len(tried) >= _CONFIRMED:
            break
        if any(float(np.max(np.abs(z - other))) < _ALIKE for other in tried):
            continue
        tried.append(z)
        fine = min(_fine_slack(problem, z, k, points) for k in range(len(problem.cases)))
        if fine > best:
            best, found = fine, z
    return found


def confirmed_by_figures(
    search: Search, wanted: Requirement, kept: Requirement, points: int
) -> Array | None:
    """Return the point whose figure is best on a finer grid while another requirement holds.

    None where no point seen holds it.
    """
    problem = search.problem
    best, found = -math.inf, None
    tried: list[Array] = []
    for slack, z in sorted(search.seen, key=lambda one: -one[0]):
        if slack <= max(best + 1e-3, KEPT_MISSED) or len(tried) >= _CONFIRMED_FIGURES:
            break
        if any(float(np.max(np.abs(z - other))) < _APART for other in tried):
            continue
        tried.append(z)
        fine = [problem.cases[k].figures(problem.gains(z), points) for k in search.cases]
        if not all(one.is_stable for one in fine) or min(one.room(kept) for one in fine) < -1e-3:
            continue
        room = min(one.room(wanted) for one in fine)
        if room > best:
            best, found = room, z
    return found


def _fine_slack(problem: Problem, z: Array, k: int, points: int) -> float:
    found = problem.cases[k].figures(problem.gains(z), points)
    if not found.is_stable:
        return UNSTABLE
    return min(found.slack(one) for one in problem.requirements)
