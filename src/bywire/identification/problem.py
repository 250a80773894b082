"""Least squares to be solved: unknowns, their residuals, and what is known beforehand."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from bywire.core.typing import Array
from bywire.identification.leftover import Part
from bywire.identification.loss import Loss, rho
from bywire.identification.unknown import Unknown

Evaluate = Callable[[Array], tuple[Array, Array]]


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
    silent
        Why nothing may depend on an unknown, by its name: what is switched off.
    parts
        Which residuals belong together, in their order; all of them by default.
    finer
        The same as ``evaluate`` in half the steps of a simulation; None where nothing is simulated.
    resolved
        Share of the cost, and of the unknowns, below which a search only follows the roughness of
        the residuals or of a Jacobian by differences.
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


def cost_of(problem: Problem, values: Array, loss: Loss = "linear") -> float:
    """Return half the sum of the residuals' losses, priors included."""
    r, _ = with_priors(problem, values)
    data = r.size - sum(u.prior is not None for u in problem.unknowns)
    return 0.5 * float(np.sum(rho(r[:data] ** 2, loss)[0]) + np.sum(r[data:] ** 2))
