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
from bywire.identification.unknown import Unknown

Array = NDArray[np.float64]
Loss = Literal["linear", "soft_l1", "huber", "cauchy"]

_TOLD = 1.0  # standard deviation per scale above which nothing is known
_FLAT = 1e-7  # singular value per the largest one: below it rounding decides


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
    """

    unknowns: tuple[Unknown, ...]
    evaluate: Callable[[Array], tuple[Array, Array]]
    apart: int = 0

    def held(self, index: int) -> Problem:
        """Return the problem with one unknown held at its start."""
        value = self.unknowns[index].start
        rest = self.unknowns[:index] + self.unknowns[index + 1 :]

        def evaluate(values: Array) -> tuple[Array, Array]:
            r, J = self.evaluate(np.insert(values, index, value))
            return r, np.delete(J, index, axis=1)

        return Problem(rest, evaluate, self.apart)


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
        found, J = _at_minimum(problem, solve(problem, begin, loss), loss)
        worst = _untold(found, J)
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


def _untold(found: Estimate, J: Array) -> tuple[int, str] | None:
    """Return the unknown that the data tells least, and why, if there is one."""
    share = found.singular_values[-1] / max(found.singular_values[0], 1e-300)
    told = f"smallest singular value {share:.1e} of the largest"
    silent = np.flatnonzero(~J.any(axis=0))
    if silent.size:
        return int(silent[0]), "nothing measured depends on it"
    if share < _FLAT:
        direction = np.linalg.svd(J, full_matrices=False)[2][-1]
        return int(np.argmax(np.abs(direction))), f"only a combination with others shows ({told})"
    relative = found.deviations / np.array([u.scale for u in found.unknowns])
    index = int(np.argmax(relative))
    if relative[index] <= _TOLD:
        return None
    unknown = found.unknowns[index]
    return index, (
        f"its standard deviation would be {relative[index]:.2g} times its usual magnitude "
        f"{unknown.scale:.3g} {unknown.unit} ({told})"
    )


def notes_of(found: Estimate) -> tuple[str, ...]:
    """Return what the user should know: unknowns that go together, or lie at a bound."""
    notes = [
        f"{a} and {b} go together (correlation {c:.3f}): the data tells their combination better "
        "than either"
        for a, b, c in found.correlated()
    ]
    units = {u.label: u.unit for u in found.unknowns}
    notes += [
        f"{label} lies at its bound, {end:.4g} {units[label]}"
        for label, end in found.at_bounds().items()
    ]
    return tuple(notes)
