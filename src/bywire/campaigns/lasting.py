"""How long something has lasted without a break, along the rows of recordings."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import minimum_filter1d, uniform_filter1d

from bywire.core.typing import Array


def least_of_the_last(values: Array, rows: int) -> Array:
    """Return the least of the last rows, the present one among them, along the last axis."""
    size = max(min(rows, values.shape[-1]), 1)
    return np.asarray(minimum_filter1d(values, size, axis=-1, origin=(size - 1) // 2))


def largest_of_the_last(values: Array, rows: int) -> Array:
    """Return the largest of the last rows, the present one among them, along the last axis."""
    return -least_of_the_last(-values, rows)


def mean_of_the_last(values: Array, rows: int) -> Array:
    """Return the mean of the last rows, the present one among them, along the last axis."""
    size = max(min(rows, values.shape[-1]), 1)
    return np.asarray(uniform_filter1d(values, size, axis=-1, origin=(size - 1) // 2))


def first_time(holds: Array, time: Array, since: Array) -> Array:
    """Return when something holds first at or after a time [s]; NaN where it never does.

    Parameters
    ----------
    holds
        Whether it does, shape (cases, rows).
    time
        Of the rows [s].
    since
        Of each case [s], shape (cases,).
    """
    counted = (holds > 0) & (time >= since[:, None] - 1e-9)
    there = counted.any(axis=1)
    return np.where(there, time[np.argmax(counted, axis=1)], np.nan)
