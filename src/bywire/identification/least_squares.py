"""Nonlinear least squares with exact Jacobians: several starts, bounds, priors, robust losses."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, Literal

import numpy as np

from bywire.bench.step_error import NO_ESTIMATE, of_difference
from bywire.core.arguments import checked
from bywire.core.errors import ParameterError, SolverError
from bywire.core.typing import Array
from bywire.core.units import difference_unit, shown
from bywire.identification.confidence import (
    MisfitWarning,
    advice,
    between_records,
    least_determined,
    misfit,
    notes_of,
    uncertainty,
)
from bywire.identification.estimate import Estimate, Kept, Part
from bywire.identification.unknown import Unknown

Loss = Literal["linear", "soft_l1", "huber", "cauchy"]

_LEAST = 1e-2  # minimum mean slope of the influence


def rho(z: Array, loss: Loss) -> Array:
    r"""Return a loss and its first two derivatives with respect to the squared residual.

    Parameters
    ----------
    z
        Squares of the residuals divided by the assumed noise, shape (n,).
    loss
        ``linear`` :math:`z`; ``soft_l1`` :math:`2(\sqrt{1+z}-1)`; ``huber`` :math:`z` up to one,
        :math:`2\sqrt z-1` beyond; ``cauchy`` :math:`\ln(1+z)`.

    Returns
    -------
    numpy.ndarray
        Shape (3, n), as ``scipy.optimize.least_squares`` requires.
    """
    ones = np.ones_like(z)
    if loss == "linear":
        return np.stack((z, ones, 0.0 * ones))
    if loss == "soft_l1":
        root = np.sqrt(1.0 + z)
        return np.stack((2.0 * (root - 1.0), 1.0 / root, -0.5 / root**3))
    if loss == "huber":
        root = np.sqrt(np.maximum(z, 1.0))
        inner = z <= 1.0
        return np.stack(
            (np.where(inner, z, 2.0 * root - 1.0), 1.0 / root, np.where(inner, 0.0, -0.5 / root**3))
        )
    return np.stack((np.log1p(z), 1.0 / (1.0 + z), -1.0 / (1.0 + z) ** 2))


def _of_data_alone(loss: Loss, apart: int) -> Any:
    """Return the loss for SciPy; the last rows are prior knowledge, with the square as loss.

    Parameters
    ----------
    apart
        Number of these rows.
    """
    if loss == "linear" or not apart:
        return loss

    def mixed(z: Array) -> Array:
        return np.hstack((rho(z[:-apart], loss), rho(z[-apart:], "linear")))

    return mixed


def influence(r: Array, loss: Loss) -> tuple[Array, Array]:
    r"""Return :math:`\psi(r) = r \rho'(r^2)` and its derivative, each of shape (n,).

    The fit minimizes half the loss of :math:`z = r^2`; :math:`\psi` is the derivative of this half
    with respect to r.

    References
    ----------
    P. J. Huber, Robust Statistics, 1981, section 3.2.
    """
    _, first, second = rho(r**2, loss)
    return r * first, first + 2.0 * r**2 * second


def _bread(slopes: Array, unknowns: int) -> float:
    r"""Return the divisor of an M-estimate's scores, :math:`E[\psi'] / K`.

    :math:`K = 1 + (p/n) \operatorname{var}(\psi') / E[\psi']^2` corrects for few residuals; the
    covariance is :math:`K^2 \, [\sum \psi^2 / (n-p)] / E[\psi']^2 \, (J^T J)^{-1}`.

    Parameters
    ----------
    slopes
        Derivatives of the influence with respect to the residual, shape (n,).
    unknowns
        p.

    References
    ----------
    P. J. Huber, Robust Statistics, 1981, section 7.6.
    """
    # With mostly outliers, a redescending loss has no meaningful minimum.
    mean = max(float(slopes.mean()), _LEAST)
    return mean / (1.0 + unknowns / slopes.size * float(slopes.var()) / mean**2)


# --- The problem: unknowns, residuals, and prior knowledge

Evaluate = Callable[[Array], tuple[Array, Array]]


@dataclass(frozen=True)
class Problem:
    """Residuals as a function of unknowns.

    Parameters
    ----------
    unknowns
        Varied unknowns; p of them.
    evaluate
        ``evaluate(values) -> (residuals, jacobian)``, shapes (n,) and (n, p), weighted so that
        residuals are about one if the noise is as assumed.
    apart
        Number of last rows that are independent of all others and already weighted.
    instrument
        Whether the Jacobian comes from a model without the noise of measured inputs, while the
        residuals contain this noise. The estimate then makes the product of the two zero, which
        avoids the bias of least squares.
    silent
        By name, reasons why no output may depend on an unknown, such as a model that is off.
    parts
        Groups of residuals, in their order; all in one by default.
    finer
        Like ``evaluate``, with half the simulation step; None without a simulation.
    resolved
        Fraction of the cost, and of the unknowns, below which a search would only follow the
        roughness of the residuals or of a finite-difference Jacobian.
    """

    unknowns: tuple[Unknown, ...]
    evaluate: Evaluate
    apart: int = 0
    instrument: bool = False
    silent: Mapping[str, str] = field(default_factory=dict)
    parts: tuple[Part, ...] = ()
    finer: Evaluate | None = None
    resolved: float = 0.0

    def held(self, index: int) -> Problem:
        """Return the problem with one unknown held at its start."""
        value = self.unknowns[index].start
        rest = self.unknowns[:index] + self.unknowns[index + 1 :]

        def without(whole: Evaluate, values: Array) -> tuple[Array, Array]:
            r, J = whole(np.insert(values, index, value))
            return r, np.delete(J, index, axis=1)

        finer = None if self.finer is None else partial(without, self.finer)
        return replace(self, unknowns=rest, evaluate=partial(without, self.evaluate), finer=finer)


def _with_priors(problem: Problem, values: Array) -> tuple[Array, Array]:
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


def _cost_of(problem: Problem, values: Array, loss: Loss = "linear") -> float:
    """Return half the sum of the residuals' losses, priors included."""
    r, _ = _with_priors(problem, values)
    data = r.size - sum(u.prior is not None for u in problem.unknowns)
    return 0.5 * float(np.sum(rho(r[:data] ** 2, loss)[0]) + np.sum(r[data:] ** 2))


# --- Effect of the simulation step on estimates: their first-order shift at half the step
# At the minimum, the weighted residuals r are orthogonal to their derivatives J. The residuals r'
# at half the step are not. One Gauss-Newton step, dx = -J^+ (r' - r), leads to their minimum. For
# a second-order method, it is three quarters of the error at the full step.

_SMALL = 1e-6  # of an unknown's scale: smaller errors are negligible


def _with_step_share(
    problem: Problem, best: Estimate, J: Array, loss: Loss
) -> tuple[Estimate, tuple[str, ...]]:
    """Return an estimate with its errors from the simulation step, and warnings.

    Parameters
    ----------
    problem
        The problem. Without its residuals at half the step, there are no errors and no warnings.
    best
        The estimate at the minimum.
    J
        Derivatives of the residuals per unknown's scale there, priors included, shape (n, p).
    loss
        Loss of the residuals.

    Returns
    -------
    Estimate
        With ``step_errors`` and the change of each part by the step; unknowns at a bound are
        assumed to stay there.
    tuple of str
        Warnings about unknowns whose error from the step exceeds the half width of their 95 %
        interval, or about a failed run at half the step.
    """
    if problem.finer is None:
        return best, ()
    count = best.residuals.size
    try:
        finer = problem.finer(best.values)[0]
        difference = np.zeros(len(J))
        difference[:count] = finer - best.residuals
    except (*NO_ESTIMATE, ValueError) as error:  # ValueError: at half the step, other rows count
        return best, (f"the effect of the step on the estimates is unknown: {error}",)
    weights = np.ones(len(J))
    measured = count - problem.apart
    weights[:measured] = np.sqrt(np.maximum(influence(best.residuals[:measured], loss)[1], 0.0))
    bounds = best.at_bounds()
    free = [k for k, u in enumerate(best.unknowns) if u.label not in bounds]
    shift = np.zeros(len(best.unknowns))
    rows = weights[:, None] * J[:, free]
    shift[free] = np.linalg.lstsq(rows, weights * difference)[0]
    scale = np.array([u.scale for u in best.unknowns])
    errors = of_difference(0.5) * np.abs(shift) * scale
    known = replace(best, step_errors=errors, parts=tuple(_parts(best.parts, difference)))
    return known, () if known.is_exact else tuple(_exceeding(best, errors))


def _parts(parts: Iterable[Part], difference: Array) -> Iterator[Part]:
    """Yield the parts of the residuals with the size of their change by the step."""
    begin = 0
    for part in parts:
        rows = difference[begin : begin + part.count]
        rms = float(np.sqrt(np.mean(rows**2))) if rows.size else 0.0
        yield replace(part, numerical=rms * (part.noise or 1.0))
        begin += part.count


def _exceeding(best: Estimate, errors: Array) -> list[str]:
    half = 0.5 * np.diff(best.intervals(), axis=1).ravel()
    return [
        f"{u.label} has an error of about {shown(float(f'{error:.2g}'), difference_unit(u.unit))} "
        "from the simulation step, more than the half-width of its 95 % interval, "
        f"{shown(float(f'{reach:.2g}'), difference_unit(u.unit))}. "
        "Use a smaller step"
        for u, error, reach in zip(best.unknowns, errors, half, strict=True)
        if error > max(reach, _SMALL * u.scale)
    ]


# --- Estimation

NO_TRIAL = (SolverError, ParameterError)
"""errors of trials whose values violate the model or the rules of its parameters"""
_NEWTON = 8  # steps from the least-squares minimum to the instrumental-variable solution
_WORSE = 0.02  # of the lowest cost: a larger increase means another minimum
_NEAR = 1e-2  # of the scale: distance from a bound at which a bounded search may stop


@dataclass(frozen=True)
class Solution:
    """End of the search from one start.

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
        Start values, shape (p,).
    loss
        Loss of the residuals; above one, a robust loss grows more slowly.
    most
        Maximum number of evaluations.
    share
        Fraction of the cost: the search ends when a step reduces the cost by less.

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
            r, J = _with_priors(problem, z * scale)
            if not (np.isfinite(r).all() and np.isfinite(J).all()):
                raise SolverError("a residual or its derivative is not defined at these values")
            cache[key] = (r, J * scale)
        return cache[key]

    def residuals(z: Array) -> Array:
        try:
            return both(z)[0]
        except NO_TRIAL:  # the step diverged or left the model's range; a shorter step follows
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
        loss=_of_data_alone(loss, priors),
        x_scale="jac",
        xtol=max(1e-9, problem.resolved),
        ftol=max(share, problem.resolved),
        gtol=1e-9,
        max_nfev=most,
    )
    solution = Solution(np.asarray(ended.x) * scale, float(ended.cost))
    return _at_bounds(problem, solution, loss)


def _at_bounds(problem: Problem, solution: Solution, loss: Loss) -> Solution:
    """Return the solution with unknowns moved to bounds that the search only approached."""
    scale = np.array([u.scale for u in problem.unknowns])
    for k, u in enumerate(problem.unknowns):
        for end in (u.low, u.high):
            if not 0.0 < abs(solution.values[k] - end) < _NEAR * scale[k]:
                continue
            values = solution.values.copy()
            values[k] = end
            try:
                cost = _cost_of(problem, values, loss)
            except SolverError:
                continue
            if cost <= solution.cost:
                solution = Solution(values, cost)
    return solution


def _solved(problem: Problem, begin: Array, loss: Loss) -> Solution:
    """Return the nearest minimum, or the instrumental-variable solution."""
    solution = solve(problem, begin, loss)
    if not problem.instrument:
        return solution
    scale = np.array([u.scale for u in problem.unknowns])
    low, high = (np.array([getattr(u, end) for u in problem.unknowns]) for end in ("low", "high"))
    values, most = solution.values, (1.0 + _WORSE) * solution.cost
    for _ in range(_NEWTON):
        r, J = _with_priors(problem, values)
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
    """Return the estimate with its uncertainty, and list undetermined unknowns.

    Parameters
    ----------
    problem
        The residuals.
    loss
        Loss of the residuals.
    start
        Start values; the unknowns' starts by default.
    search
        False if these values are already a minimum.

    Raises
    ------
    ParameterError
        When the data determine none of the unknowns.
    """
    kept: tuple[Kept, ...] = ()
    origin = problem
    begin = np.array([u.start for u in problem.unknowns]) if start is None else start
    while True:
        solution = _solved(problem, begin, loss) if search else Solution(begin, math.nan)
        best, J = _at_minimum(problem, solution, loss)
        worst = least_determined(best, J)
        if worst is None:
            records = between_records(best, J) if loss == "linear" else ()
            apart = tuple(str(record) for record in records[:1])
            best, coarse = _with_step_share(problem, best, J, loss)
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
                f"the data determine none of {', '.join(k.unknown.label for k in kept)}. For "
                f"{kept[0].unknown.label}, {kept[0].reason}. "
                f"{advice(best, kept[0].unknown.name in problem.silent)}",
                name=", ".join(k.unknown.label for k in kept),
            )


def _at_minimum(problem: Problem, solution: Solution, loss: Loss) -> tuple[Estimate, Array]:
    """Return the estimate, and the Jacobian per unknown's scale."""
    r, J = _with_priors(problem, solution.values)
    priors = sum(u.prior is not None for u in problem.unknowns)
    data = r.size - priors
    if data <= len(problem.unknowns):
        raise ParameterError(
            f"{data} measured values cannot determine {len(problem.unknowns)} unknowns. Record "
            "more data",
            name="unknowns",
            value=str(len(problem.unknowns)),
        )
    scale = np.array([u.scale for u in problem.unknowns])
    known = priors + problem.apart
    # Prior knowledge is not an outlier; the loss weights measured values only.
    psi, slopes = influence(r[: r.size - known], loss)
    rows = J.copy()
    rows[: r.size - known] *= _bread(slopes, len(problem.unknowns))
    sure = uncertainty(
        rows * scale,
        np.concatenate((psi, r[r.size - known :])),
        J * scale,
        prior_rows=known,
        ordered=not problem.parts or any(part.count > 1 for part in problem.parts),
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
