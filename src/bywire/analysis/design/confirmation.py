"""The best points of a search, looked at anew on a finer grid of frequencies."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from bywire.analysis.design.optimizer import UNSTABLE, Problem, Search

Array = NDArray[np.float64]

_CONFIRMED, _ALIKE = 40, 1e-3  # points looked at anew, and how far apart


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


def _fine_slack(problem: Problem, z: Array, k: int, points: int) -> float:
    found = problem.cases[k].figures(problem.gains(z), points)
    if not found.is_stable:
        return UNSTABLE
    return min(found.slack(one) for one in problem.requirements)
