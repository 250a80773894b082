"""Residuals of a fit: variance explained, and tests against richer models."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bywire.core.arguments import checked
from bywire.core.typing import Array
from bywire.identification.confidence import autoregression, is_white
from bywire.identification.estimate import Estimate
from bywire.identification.method import Check
from bywire.identification.output_error import Trial

_LEVEL = 1e-3  # probability of a false alarm


@checked
def lack_of_fit(
    name: str, residuals: Array, weights: Array, richer: Array, unknowns: int, note: str
) -> Check:
    r"""Return the improvement of the fit by a richer model, as Fisher's F.

    .. math:: F = \frac{(S - S_r) / (r - p)}{S_r / (n - r)}

    with S the weighted sum of squared residuals, and S_r that of a model with r columns, which
    contains the p unknowns of the fitted one to first order. For correlated readings, F is divided
    by the ratio of slow noise to the average. F is about one for a complete model, and exceeds the
    limit by chance once in a thousand times.

    Parameters
    ----------
    name
        Name of the check.
    residuals
        One per reading, in the order of time, in its unit, shape (n,).
    weights
        Weights of the readings, shape (n,): the inverse of their scatter.
    richer
        Columns of the richer model, shape (n, r).
    unknowns
        p.
    note
        Additional effect in the richer model.
    """
    from scipy import special

    e, A = residuals * weights, richer * weights[:, None]
    r = int(np.linalg.matrix_rank(A))
    more, left = r - unknowns, e.size - r
    if more < 1 or left < 1:
        return Check(name, 0.0, note=f"too few readings for this check: {note}")
    rest = e - A @ np.linalg.lstsq(A, e, rcond=None)[0]
    within = max(float(rest @ rest) / left, 1e-300)
    # A richer model changes slow components, where colored noise is larger than on average.
    slow = 1.0 if is_white(rest) else autoregression(rest).at_zero_frequency / within
    value = float(e @ e - rest @ rest) / more / (within * max(slow, 1.0))
    return Check(
        name,
        value,
        limit=float(special.fdtri(more, left, 1.0 - _LEVEL)),
        note=note,
        next_step="find the bend in the curve. Identify only the straight part of the range, or a "
        "nonlinear law",
    )


def by_output(
    trials: Sequence[Trial], residuals: NDArray[Any]
) -> Iterator[tuple[Trial, str, NDArray[Any]]]:
    """Yield trial, output and its part of the residuals, in the order of `output_error`."""
    begin = 0
    for trial in trials:
        for name in trial.measured:
            end = begin + int(trial.rows(name).sum())
            yield trial, name, residuals[begin:end]
            begin = end


def explained(
    trials: Sequence[Trial], estimate: Estimate, counted: NDArray[np.bool_] | None = None
) -> float:
    """Return the variance accounted for, relative to the mean of each record and output.

    Parameters
    ----------
    trials
        Fitted trials.
    estimate
        Estimate with its residuals.
    counted
        Mask of the evaluated residuals, shape (n,); all by default.
    """
    counted = np.ones(estimate.residuals.size, dtype=bool) if counted is None else counted
    total = 0.0
    for trial, name, among in by_output(trials, counted):
        values = trial.measured[name][trial.rows(name)][among]
        if values.size:
            total += float(np.sum(((values - values.mean()) / trial.noise[name]) ** 2))
    left = estimate.residuals[counted]
    return 1.0 - float(left @ left) / max(total, 1e-300)
