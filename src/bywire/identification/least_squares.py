"""Nonlinear least squares with exact Jacobians: several starts, bounds, priors, robust losses."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from bywire.core.errors import ParameterError, SolverError
from bywire.identification.confidence import uncertainty
from bywire.identification.estimate import Estimate, Kept
from bywire.identification.identifiability import notes_of, untold
from bywire.identification.unknown import Unknown

Array = NDArray[np.float64]
Loss = Literal["linear", "soft_l1", "huber", "cauchy"]

_NEWTON = 8  # steps from the least sum to where instruments see no residual
_WORSE = 0.02  # of the least sum of squares: more is another place


@dataclass(frozen=True)
class Problem:
    """Residuals as a function of unknowns.

    Parameters
    ----------
    unknowns
        What is varied; p of them.
    evaluate
        ``evaluate(values) -> (residuals, jacobian)``, shapes (n,) and (n, p), weighted so that
        residuals are of size one where the noise is as assumed.
    apart
        Last rows that are independent of all others and taken to be weighted rightly.
    instrument
        Whether the Jacobian is that of a model which the measured inputs' noise does not drive,
        while it drives that of the residuals. Where their product vanishes, the estimate is then
        free of the bias that the least sum of squares has.
    """

    unknowns: tuple[Unknown, ...]
    evaluate: Callable[[Array], tuple[Array, Array]]
    apart: int = 0
    instrument: bool = False

    def held(self, index: int) -> Problem:
        """Return the problem with one unknown held at its start."""
        value = self.unknowns[index].start
        rest = self.unknowns[:index] + self.unknowns[index + 1 :]

        def evaluate(values: Array) -> tuple[Array, Array]:
            r, J = self.evaluate(np.insert(values, index, value))
            return r, np.delete(J, index, axis=1)

        return replace(self, unknowns=rest, evaluate=evaluate)


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
            cache[key] = (r, J * scale)
        return cache[key]

    def residuals(z: Array) -> Array:
        try:
            return both(z)[0]
        except SolverError:  # a trial step left the numbers: refused, a shorter one follows
            return np.full(cache_size[0], 1e6)

    def jacobian(z: Array) -> Array:
        return both(z)[1]

    cache_size = [both(start / scale)[0].size]
    margin = 1e-9
    inner = np.clip(start / scale, low + margin, high - margin)
    found = optimize.least_squares(
        residuals, inner, jacobian, bounds=(low, high), loss=loss, x_scale="jac",
        xtol=1e-9, ftol=share, gtol=1e-9, max_nfev=most,
    )  # fmt: skip
    return Solution(np.asarray(found.x) * scale, float(found.cost))


def _solved(problem: Problem, begin: Array, loss: Loss) -> Solution:
    """Return the nearest minimum, or what is no least sum where the Jacobian is an instrument."""
    found = solve(problem, begin, loss)
    if not problem.instrument:
        return found
    scale = np.array([u.scale for u in problem.unknowns])
    low, high = (np.array([getattr(u, end) for u in problem.unknowns]) for end in ("low", "high"))
    values, most = found.values, (1.0 + _WORSE) * found.cost
    for _ in range(_NEWTON):
        r, J = with_priors(problem, values)
        cost = 0.5 * float(r @ r)
        if cost > most:
            return found
        step = np.linalg.lstsq(J * scale, r)[0]
        values = np.clip(values - step * scale, low, high)
        if np.abs(step).max() < 1e-7:
            break
    return Solution(values, cost)


def with_priors(problem: Problem, values: Array) -> tuple[Array, Array]:
    """Return residuals and Jacobian with one more row for every prior."""
    r, J = problem.evaluate(values)
    rows = [(k, u.prior) for k, u in enumerate(problem.unknowns) if u.prior is not None]
    if not rows:
        return r, J
    more = np.array([(values[k] - mean) / deviation for k, (mean, deviation) in rows])
    slopes = np.zeros((len(rows), len(values)))
    for row, (k, (_, deviation)) in enumerate(rows):
        slopes[row, k] = 1.0 / deviation
    return np.concatenate((r, more)), np.vstack((J, slopes))


def estimate(problem: Problem, loss: Loss = "linear", start: Array | None = None) -> Estimate:
    """Return the estimate with its uncertainty; what the data does not tell is kept and named.

    Parameters
    ----------
    problem
        The residuals.
    loss
        How large residuals count.
    start
        Where to begin; the unknowns' starts by default.

    Raises
    ------
    ParameterError
        When the data tells none of the unknowns.
    """
    kept: tuple[Kept, ...] = ()
    origin = problem
    begin = np.array([u.start for u in problem.unknowns]) if start is None else start
    while True:
        found, J = _at_minimum(problem, _solved(problem, begin, loss), loss)
        worst = untold(found, J)
        if worst is None:
            return replace(found, kept=kept, notes=notes_of(found))
        index, reason = worst
        first = next(u for u in origin.unknowns if u.label == problem.unknowns[index].label)
        kept = (*kept, Kept(first, reason))
        begin = np.delete(found.values, index)
        problem = problem.held(index)
        if not problem.unknowns:
            names = ", ".join(k.unknown.label for k in kept)
            raise ParameterError(
                f"the data tells none of {names}: {kept[0].reason}; excite the system more"
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
    if loss != "linear":
        weight = np.sqrt(_slope(r, loss))
        r, J = r * weight, J * weight[:, None]
    scale = np.array([u.scale for u in problem.unknowns])
    sure = uncertainty(J * scale, r, prior_rows=priors + problem.apart)
    found = Estimate(
        unknowns=problem.unknowns,
        values=solution.values,
        covariance=sure.covariance * np.outer(scale, scale),
        singular_values=np.linalg.svd(J * scale, compute_uv=False),
        residuals=r[:data],
        freedom=sure.freedom,
        colored=sure.colored,
    )
    return found, J * scale


def _slope(r: Array, loss: Loss) -> Array:
    """Return the derivative of the loss by the squared residual: the weight of each residual."""
    z = r**2
    if loss == "soft_l1":
        return np.asarray((1.0 + z) ** -0.5)
    if loss == "huber":
        return np.where(z <= 1.0, 1.0, np.maximum(z, 1.0) ** -0.5)
    return np.asarray(1.0 / (1.0 + z))
