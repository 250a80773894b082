"""Residuals of one slip that share an error of the measured current, made independent."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Whitening:
    r"""Makes residuals independent that share an error of the measured current.

    With a current that is off by one standard deviation d along a slip, their covariance is
    :math:`I + d d^T`; its inverse root is :math:`I - (1 - 1 / \sqrt{1 + d^T d}) u u^T` with u along
    d.

    Parameters
    ----------
    d
        What an error of one standard deviation does to the residuals, shape (n,).
    """

    def __init__(self, d: Array) -> None:
        size = float(d @ d)
        self._u = d / np.sqrt(size) if size > 0.0 else d
        self._share = 1.0 - 1.0 / np.sqrt(1.0 + size)

    def __call__(self, values: Array) -> Array:
        """Return residuals or their Jacobian, shape (n,) or (n, p), made independent."""
        along = self._u @ values
        taken = np.outer(self._u, along).reshape(values.shape)
        return np.asarray(values - self._share * taken)
