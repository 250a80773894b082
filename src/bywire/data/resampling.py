"""Values of a sampled signal at other instants."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

METHODS = ("linear", "previous", "nearest", "average")
"""how values between samples are found"""

_Values = Callable[[NDArray[np.float64]], NDArray[np.float64]]

_BLOCK = 1 << 20  # instants that are found together: what it takes beside the result
_SLACK = 1e-9  # intervals: rounding of instants that are meant to be the same


def resampled(
    time: NDArray[np.float64],
    values: NDArray[np.float64],
    axis: NDArray[np.float64],
    step: float,
    method: str,
) -> NDArray[np.float64]:
    """Return a signal at other instants.

    Parameters
    ----------
    time, values
        Increasing instants [s] and values there, shape ``(sample,)``; none is NaN.
    axis
        Instants wanted [s], within those of the signal, shape ``(instant,)``.
    step
        Their distance [s].
    method
        One of ``METHODS``, see `bywire.data.alignment.resample`.

    Returns
    -------
    numpy.ndarray
        Shape ``(instant,)``.
    """
    pieces = range(0, axis.size, _BLOCK)
    at = _means(time, values, step) if method == "average" else _samples(time, values, step, method)
    return np.concatenate([at(axis[begin : begin + _BLOCK]) for begin in pieces])


def _samples(
    time: NDArray[np.float64], values: NDArray[np.float64], step: float, method: str
) -> _Values:
    """Return the function that finds the values at instants between samples."""

    def at(axis: NDArray[np.float64]) -> NDArray[np.float64]:
        before = np.searchsorted(time, axis + _SLACK * step, side="right") - 1
        before = np.clip(before, 0, time.size - 1)
        if method == "linear":
            line = np.asarray(np.interp(axis, time, values))
            # A sample that lies on the axis, but for rounding, is kept to its last digit.
            return np.where(np.abs(time[before] - axis) <= _SLACK * step, values[before], line)
        if method == "nearest":
            after = np.minimum(before + 1, time.size - 1)
            before = np.where(time[after] - axis < axis - time[before], after, before)
        return np.asarray(values[before], dtype=np.float64)

    return at


def _means(time: NDArray[np.float64], values: NDArray[np.float64], step: float) -> _Values:
    """Return the function that finds the mean of the line through the samples over a step."""
    # The mean is taken off first: what is summed up stays small, and so does its rounding.
    middle = float(values.mean())
    areas = np.diff(time) * (0.5 * (values[1:] + values[:-1]) - middle)
    total = np.concatenate([[0.0], np.cumsum(areas)])

    def at(axis: NDArray[np.float64]) -> NDArray[np.float64]:
        edges = np.append(axis - step / 2.0, axis[-1] + step / 2.0)
        edges = np.clip(edges, time[0], time[-1])
        at_edges = np.interp(edges, time, values)
        k = np.clip(np.searchsorted(time, edges, side="right") - 1, 0, time.size - 2)
        into = (edges - time[k]) * (0.5 * (at_edges + values[k]) - middle)
        return np.asarray(middle + np.diff(total[k] + into) / np.diff(edges))

    return at
