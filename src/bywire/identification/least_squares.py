"""Nonlinear least squares with exact Jacobians: several starts, bounds, priors, robust losses."""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass, replace

import numpy as np

from bywire.core.arguments import checked
from bywire.core.errors import ParameterError, SolverError
from bywire.core.typing import Array
from bywire.identification.confidence import uncertainty
from bywire.identification.estimate import Estimate, Kept
from bywire.identification.homogeneity import between_records
from bywire.identification.identifiability import (
    MisfitWarning,
    advice,
    misfit,
    notes_of,
    untold,
)
from bywire.identification.leftover import Part
from bywire.identification.loss import Loss, bread, influence, of_data_alone
from bywire.identification.problem import Problem, cost_of, with_priors
from bywire.identification.step_share import with_step_share

__all__ = ["Loss", "Problem", "Solution", "estimate", "solve", "with_priors"]


NO_TRIAL = (SolverError, ParameterError)
"""what a trial ends with whose values the model, or its parameters' own rules, do not take"""
_NEWTON = 8  # steps from the least sum to where instruments see no residual
_WORSE = 0.02  # of the least sum of squares: more is another place
_NEAR = 1e-2  # of the scale: how far from a bound a search with bounds may stop short of it


@dataclass(frozen=True)
class Solution:
    """Where one start led.

    Parameters
    ----------
    values
        Shape (p,).
    cost
        Half the sum of squared residuals, loss and priors included.
    """

    values: Array
    cost: float


def solve(
    problem: Problem, start: Array, loss: Loss = "linear", most: int = 60, share: float = 1e-11
) -> Solution:
    """Return the nearest minimum (trust region with bounds, SciPy).

    Parameters
    ----------
    start
        Where to begin, shape (p,).
    loss
        How large residuals count; beyond size one a robust loss grows slower.
    most
        Evaluations at most.
    share
        Of the cost: the search ends when a step gains less.

    Raises
    ------
    SolverError
        When no residual can be computed at the start.
    """
    from scipy import optimize

    unknowns = problem.unknowns
    scale = np.array([u.scale for u in unknowns])
    low = np.array([u.low for u in unknowns]) / scale
    high = np.array([u.high for u in unknowns]) / scale
    cache: dict[bytes, tuple[Array, Array]] = {}

    def both(z: Array) -> tuple[Array, Array]:
        key = z.tobytes()
        if key not in cache:
            cache.clear()
            r, J = with_priors(problem, z * scale)
            if not (np.isfinite(r).all() and np.isfinite(J).all()):
                raise SolverError("a residual, or how it changes, is not defined at these values")
            cache[key] = (r, J * scale)
        return cache[key]

    def residuals(z: Array) -> Array:
        try:
            return both(z)[0]
        except NO_TRIAL:  # a step left the numbers, or what the model takes: a shorter one follows
            return np.full(cache_size[0], 1e6)

    def jacobian(z: Array) -> Array:
        return both(z)[1]

    cache_size = [both(start / scale)[0].size]
    priors = sum(u.prior is not None for u in unknowns)
    margin = 1e-9
    inner = np.clip(start / scale, low + margin, high - margin)
    ended = optimize.least_squares(
        residuals,
        inner,
        jacobian,
        bounds=(low, high),
        loss=of_data_alone(loss, priors),
        x_scale="jac",
        xtol=max(1e-9, problem.resolved),
        ftol=max(share, problem.resolved),
        gtol=1e-9,
        max_nfev=most,
    )
    solution = Solution(np.asarray(ended.x) * scale, float(ended.cost))
    return _at_bounds(problem, solution, loss)


def _at_bounds(problem: Problem, solution: Solution, loss: Loss) -> Solution:
    """Return the solution with unknowns at the bounds that the search only came near to."""
    scale = np.array([u.scale for u in problem.unknowns])
    for k, u in enumerate(problem.unknowns):
        for end in (u.low, u.high):
            if not 0.0 < abs(solution.values[k] - end) < _NEAR * scale[k]:
                continue
            values = solution.values.copy()
            values[k] = end
            try:
                cost = cost_of(problem, values, loss)
            except SolverError:
                continue
            if cost <= solution.cost:
                solution = Solution(values, cost)
    return solution


def _solved(problem: Problem, begin: Array, loss: Loss) -> Solution:
    """Return the nearest minimum, or what is no least sum where the Jacobian is an instrument."""
    solution = solve(problem, begin, loss)
    if not problem.instrument:
        return solution
    scale = np.array([u.scale for u in problem.unknowns])
    low, high = (np.array([getattr(u, end) for u in problem.unknowns]) for end in ("low", "high"))
    values, most = solution.values, (1.0 + _WORSE) * solution.cost
    for _ in range(_NEWTON):
        r, J = with_priors(problem, values)
        cost = 0.5 * float(r @ r)
        if cost > most:
            return solution
        step = np.linalg.lstsq(J * scale, r)[0]
        values = np.clip(values - step * scale, low, high)
        if np.abs(step).max() < 1e-7:
            break
    return Solution(values, cost)


@checked
def estimate(
    problem: Problem, loss: Loss = "linear", start: Array | None = None, *, search: bool = True
) -> Estimate:
    """Return the estimate with its uncertainty; what the data does not tell is kept and named.

    Parameters
    ----------
    problem
        The residuals.
    loss
        How large residuals count.
    start
        Where to begin; the unknowns' starts by default.
    search
        False: these values are a minimum already, and are taken as they are.

    Raises
    ------
    ParameterError
        When the data tells none of the unknowns.
    """
    kept: tuple[Kept, ...] = ()
    origin = problem
    begin = np.array([u.start for u in problem.unknowns]) if start is None else start
    while True:
        solution = _solved(problem, begin, loss) if search else Solution(begin, math.nan)
        best, J = _at_minimum(problem, solution, loss)
        worst = untold(best, J)
        if worst is None:
            records = between_records(best, J) if loss == "linear" else ()
            apart = tuple(str(record) for record in records[:1])
            best, coarse = with_step_share(problem, best, J, loss)
            for wrong in filter(None, (misfit(best), *apart, *coarse)):
                warnings.warn(wrong, MisfitWarning, stacklevel=2)
            return replace(best, kept=kept, notes=(*notes_of(best), *apart, *coarse))
        index, reason = worst
        unknown = problem.unknowns[index]
        if not J[:, index].any() and unknown.name in problem.silent:
            reason = f"{reason} ({problem.silent[unknown.name]})"
        first = next(u for u in origin.unknowns if u.label == unknown.label)
        kept = (*kept, Kept(first, reason))
        begin = np.delete(best.values, index)
        problem = problem.held(index)
        if not problem.unknowns:
            raise ParameterError(
                f"the data tells none of {', '.join(k.unknown.label for k in kept)}: of "
                f"{kept[0].unknown.label}, {kept[0].reason}; "
                f"{advice(best, kept[0].unknown.name in problem.silent)}"
            )


def _at_minimum(problem: Problem, solution: Solution, loss: Loss) -> tuple[Estimate, Array]:
    """Return the estimate, and the Jacobian per unknown's scale."""
    r, J = with_priors(problem, solution.values)
    priors = sum(u.prior is not None for u in problem.unknowns)
    data = r.size - priors
    if data <= len(problem.unknowns):
        raise ParameterError(
            f"{data} measured values cannot tell {len(problem.unknowns)} unknowns: measure more"
        )
    scale = np.array([u.scale for u in problem.unknowns])
    known = priors + problem.apart
    # What is known beforehand is no outlier; only what was measured is weighted by the loss.
    psi, slopes = influence(r[: r.size - known], loss)
    rows = J.copy()
    rows[: r.size - known] *= bread(slopes, len(problem.unknowns))
    sure = uncertainty(
        rows * scale, np.concatenate((psi, r[r.size - known :])), J * scale, prior_rows=known
    )
    best = Estimate(
        unknowns=problem.unknowns,
        values=solution.values,
        covariance=sure.covariance * np.outer(scale, scale),
        singular_values=np.linalg.svd(J * scale, compute_uv=False),
        residuals=r[:data],
        freedom=sure.freedom,
        colored=sure.colored,
        parts=problem.parts or (Part("residuals", "", data - problem.apart),),
    )
    return best, J * scale
