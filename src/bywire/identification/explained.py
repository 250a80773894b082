"""How much of what was measured a model predicts, by the noise of each signal."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bywire.identification.estimate import Estimate
from bywire.identification.output_error import Trial


def by_output(
    trials: Sequence[Trial], residuals: NDArray[Any]
) -> Iterator[tuple[Trial, str, NDArray[Any]]]:
    """Yield trial, output and its part of the residuals, in the order of `output_error`."""
    begin = 0
    for one in trials:
        for name in one.measured:
            end = begin + int(one.rows(name).sum())
            yield one, name, residuals[begin:end]
            begin = end


def explained(
    trials: Sequence[Trial], found: Estimate, counted: NDArray[np.bool_] | None = None
) -> float:
    """Return the variance accounted for, each record and output about its own mean.

    Parameters
    ----------
    trials
        What was fitted.
    found
        With the residuals that are left.
    counted
        Which residuals count, shape (n,); all by default.
    """
    counted = np.ones(found.residuals.size, dtype=bool) if counted is None else counted
    total = 0.0
    for one, name, among in by_output(trials, counted):
        values = one.measured[name][one.rows(name)][among]
        if values.size:
            total += float(np.sum(((values - values.mean()) / one.noise[name]) ** 2))
    left = found.residuals[counted]
    return 1.0 - float(left @ left) / max(total, 1e-300)
