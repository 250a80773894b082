"""What noise of a measured input does to a computed output, and residuals freed from it.

A model run over a measured current answers to its noise too: slowly, as the brake does, so that
neighboring residuals go together over seconds. Their covariance is known but for two variances.
"""

from __future__ import annotations

import numpy as np

from bywire.brakes.motorcycle.methods.braking.slow_pair import impulse
from bywire.core.typing import Array


class Whitening:
    r"""Makes residuals of block means independent, of size one.

    .. math::
        \Sigma = \sigma^2 I + \sigma_u^2 (H - H 1 w^T)(H - H 1 w^T)^T

    with H the response of the means to every sample of the input, and w the mean before the step,
    which is taken off the input.

    Parameters
    ----------
    values
        K, tau_L, T1, T2, T_L of the model that answers; SI, shape (5,).
    blocks, block
        Number of means, and samples in each.
    rest
        Samples before the step whose mean is taken off.
    sigma, sigma_u
        Noise of a mean of the output, and of a sample of the input.
    interval
        Sample time [s].
    """

    def __init__(
        self, values: Array, blocks: int, block: int, rest: int, sigma: float, sigma_u: float,
        interval: float,
    ) -> None:  # fmt: skip
        n = blocks * block
        h = impulse(values, n, interval)
        means = np.convolve(h, np.ones(block) / block)[:n]
        # Row k: the mean over the block that ends with sample (k + 1) block - 1.
        last = (np.arange(blocks) + 1) * block - 1
        back = last[:, None] - np.arange(n)[None, :]
        H = np.where(back >= 0, means[np.clip(back, 0, n - 1)], 0.0)
        H[:, :rest] -= H.sum(axis=1)[:, None] / rest
        covariance = sigma_u**2 * (H @ H.T)
        covariance[np.diag_indices(blocks)] += sigma**2
        self._root = np.linalg.cholesky(covariance)

    def __call__(self, values: Array) -> Array:
        """Return residuals or their Jacobian, shape (blocks,) or (blocks, p), made independent."""
        from scipy import linalg

        return np.asarray(linalg.solve_triangular(self._root, values, lower=True))
