"""How large numbers are."""

from __future__ import annotations

import numpy as np

from bywire.core.typing import Array


def size_of(values: Array) -> float:
    """Return the largest magnitude of values; 0 without any that is finite.

    Examples
    --------
    >>> size_of(np.array([1.0, -3.0, np.nan])), size_of(np.array([]))
    (3.0, 0.0)
    """
    return float(np.max(np.abs(values[np.isfinite(values)]), initial=0.0))
