"""What the step of a simulation does to estimates: their first-order shift in half steps.

At the minimum the weighted residuals r are orthogonal to their derivatives J. With the residuals
r' of half the step they are not, and one Gauss-Newton step leads to the minimum there,
dx = -J^+ (r' - r): three quarters of the error of the whole step, at second order.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np

from bywire.bench.step_error import NO_ESTIMATE, of_difference
from bywire.core.typing import Array
from bywire.core.units import difference_unit, shown
from bywire.identification.estimate import Estimate
from bywire.identification.leftover import Part
from bywire.identification.loss import Loss, influence
from bywire.identification.problem import Problem

_SMALL = 1e-6  # of an unknown's scale: less matters to nobody


def with_step_share(
    problem: Problem, best: Estimate, J: Array, loss: Loss
) -> tuple[Estimate, tuple[str, ...]]:
    """Return an estimate with the errors that its values have from the step, and what exceeds.

    Parameters
    ----------
    problem
        With residuals in half steps; without, nothing is simulated and nothing is said.
    best
        The estimate at the minimum.
    J
        Derivatives of the residuals per unknown's scale there, priors included, shape (n, p).
    loss
        How large residuals count.

    Returns
    -------
    Estimate
        With ``step_errors`` and what the step changes of each part; unknowns at a bound are taken
        to stay there.
    tuple of str
        Unknowns whose error from the step exceeds the half width of their 95 % interval, or that
        half steps cannot be run.
    """
    if problem.finer is None:
        return best, ()
    count = best.residuals.size
    try:
        finer = problem.finer(best.values)[0]
        difference = np.zeros(len(J))
        difference[:count] = finer - best.residuals
    except (*NO_ESTIMATE, ValueError) as error:  # a ValueError: other rows count in half steps
        return best, (f"what the step does to the estimates is not known: {error}",)
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
    """Yield the parts of the residuals with the size of what the step changes of them."""
    begin = 0
    for part in parts:
        rows = difference[begin : begin + part.count]
        rms = float(np.sqrt(np.mean(rows**2))) if rows.size else 0.0
        yield replace(part, numerical=rms * (part.noise or 1.0))
        begin += part.count


def _exceeding(best: Estimate, errors: Array) -> list[str]:
    half = 0.5 * np.diff(best.intervals(), axis=1).ravel()
    return [
        f"{u.label} is off by about {shown(float(f'{error:.2g}'), difference_unit(u.unit))} from "
        "the step of the simulation, more than its 95 % interval reaches, "
        f"{shown(float(f'{reach:.2g}'), difference_unit(u.unit))}: "
        "take a smaller step"
        for u, error, reach in zip(best.unknowns, errors, half, strict=True)
        if error > max(reach, _SMALL * u.scale)
    ]
