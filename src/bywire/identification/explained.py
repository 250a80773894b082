"""How much of what was measured a model predicts, by the noise of each signal."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from bywire.identification.estimate import Estimate
from bywire.identification.output_error import Trial


def explained(trials: Sequence[Trial], found: Estimate) -> float:
    """Return the variance accounted for, each record and output about its own mean.

    Parameters
    ----------
    trials
        What was fitted.
    found
        With the residuals that are left.
    """
    total = 0.0
    for one in trials:
        for name, values in one.measured.items():
            counted = values[one.rows(name)]
            total += float(np.sum(((counted - counted.mean()) / one.noise[name]) ** 2))
    return 1.0 - float(found.residuals @ found.residuals) / max(total, 1e-300)
