"""Residuals of one slip freed from what errors of the measured current do to all of them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bywire.identification.stick_slip.shooting import Fitted

Array = NDArray[np.float64]

_BLOCKS = 250  # at most


class Whitening:
    r"""Makes means of neighboring residuals independent, of size one.

    .. math:: \Sigma = \sigma^2 I + P H H^T P \sigma_i^2 + d d^T

    with the answer H of the pressure to every sample of the current, taken from that to a lasting
    offset as if the slip answered alike at all times; P takes off what a shift in time takes up;
    d is an offset of one standard deviation.

    Parameters
    ----------
    one
        A slip of the model.
    sigma, sigma_i
        Noise of a sample of the pressure [Pa], and of the current [A]; 0 leaves H out, which is
        quick.
    scatter
        Standard deviation of an offset of the current along the slip [A].
    """

    def __init__(self, one: Fitted, sigma: float, sigma_i: float, scatter: float) -> None:
        self._block = max(-(-one.residuals.size // _BLOCKS), 1)
        self._sigma = sigma / np.sqrt(self._block)
        d = self._means(one.by_current) * (scatter / self._sigma)
        size = float(d @ d)
        self._u = d / np.sqrt(size) if size > 0.0 else d
        self._share = 1.0 - 1.0 / np.sqrt(1.0 + size)
        self._root = self._full_root(one, sigma_i, d) if sigma_i > 0.0 else None

    def __call__(self, values: Array) -> Array:
        """Return residuals or their Jacobian, shape (n,) or (n, p), as fewer independent rows."""
        from scipy import linalg

        means = self._means(values) / self._sigma
        if self._root is not None:
            return np.asarray(linalg.solve_triangular(self._root, means, lower=True))
        along = self._u @ means
        return np.asarray(means - self._share * np.outer(self._u, along).reshape(means.shape))

    def _full_root(self, one: Fitted, sigma_i: float, d: Array) -> Array:
        """Return the root of the whole covariance, in units of the pressure's noise."""
        answer = np.diff(self._means(one.answer), prepend=0.0)
        count = answer.size
        back = np.arange(count)[:, None] - np.arange(count)[None, :]
        H = np.where(back >= 0, answer[np.clip(back, 0, count - 1)], 0.0)
        v = self._means(one.speed)
        H -= np.outer(v, v @ H) / max(float(v @ v), 1e-300)
        H *= sigma_i / (np.sqrt(self._block) * self._sigma)
        covariance = H @ H.T + np.outer(d, d)
        covariance[np.diag_indices(count)] += 1.0
        return np.asarray(np.linalg.cholesky(covariance), dtype=float)

    def _means(self, values: Array) -> Array:
        count = len(values) // self._block
        parts = values[: count * self._block].reshape(count, self._block, *values.shape[1:])
        return np.asarray(parts.mean(axis=1))
