"""Residuals of one slip freed from what the noise of the measured current does to all of them."""

from __future__ import annotations

import numpy as np

from bywire.brakes.motorcycle.methods.stick_slip.shooting import Fitted
from bywire.core.typing import Array

_BLOCKS = 250  # at most


class Whitening:
    r"""Makes means of neighboring residuals independent, of size one.

    .. math:: \Sigma = \sigma^2 I + P H H^T P \sigma_i^2

    with the answer H of the pressure to every sample of the current, taken from that to a lasting
    offset as if the slip answered alike at all times; P takes off what a shift in time takes up.

    Parameters
    ----------
    one
        A slip of the model.
    sigma, sigma_i
        Noise of a sample of the pressure [Pa], and of the current [A] that drives the slip; 0
        where none does.
    """

    def __init__(self, one: Fitted, sigma: float, sigma_i: float) -> None:
        self._block = max(-(-one.residuals.size // _BLOCKS), 1)
        self._sigma = sigma / np.sqrt(self._block)
        self._root = self._root_of(one, sigma_i) if sigma_i > 0.0 else None

    def __call__(self, values: Array) -> Array:
        """Return residuals or their Jacobian, shape (n,) or (n, p), as fewer independent rows."""
        from scipy import linalg

        means: Array = self._means(values) / self._sigma
        if self._root is None:
            return means
        return np.asarray(linalg.solve_triangular(self._root, means, lower=True))

    def _root_of(self, one: Fitted, sigma_i: float) -> Array:
        """Return the root of the covariance, in units of the pressure's noise."""
        answer = np.diff(self._means(one.answer), prepend=0.0)
        count = answer.size
        back = np.arange(count)[:, None] - np.arange(count)[None, :]
        H = np.where(back >= 0, answer[np.clip(back, 0, count - 1)], 0.0)
        v = self._means(one.speed)
        H -= np.outer(v, v @ H) / max(float(v @ v), 1e-300)
        H *= sigma_i / (np.sqrt(self._block) * self._sigma)
        covariance = H @ H.T
        covariance[np.diag_indices(count)] += 1.0
        return np.asarray(np.linalg.cholesky(covariance), dtype=float)

    def _means(self, values: Array) -> Array:
        count = len(values) // self._block
        parts = values[: count * self._block].reshape(count, self._block, *values.shape[1:])
        return np.asarray(parts.mean(axis=1))
