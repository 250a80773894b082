"""Robust losses of least squares: how large residuals count, and what they tell of the estimate."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np

from bywire.core.typing import Array

Loss = Literal["linear", "soft_l1", "huber", "cauchy"]

_LEAST = 1e-2  # mean slope of the influence


def rho(z: Array, loss: Loss) -> Array:
    r"""Return a loss and its first two derivatives by the squared residual.

    Parameters
    ----------
    z
        Squared residuals, those of size one where the noise is as assumed, shape (n,).
    loss
        ``linear`` :math:`z`; ``soft_l1`` :math:`2(\sqrt{1+z}-1)`; ``huber`` :math:`z` up to one,
        :math:`2\sqrt z-1` beyond; ``cauchy`` :math:`\ln(1+z)`.

    Returns
    -------
    numpy.ndarray
        Shape (3, n), as ``scipy.optimize.least_squares`` wants it.
    """
    ones = np.ones_like(z)
    if loss == "linear":
        return np.stack((z, ones, 0.0 * ones))
    if loss == "soft_l1":
        root = np.sqrt(1.0 + z)
        return np.stack((2.0 * (root - 1.0), 1.0 / root, -0.5 / root**3))
    if loss == "huber":
        root = np.sqrt(np.maximum(z, 1.0))
        inner = z <= 1.0
        return np.stack(
            (np.where(inner, z, 2.0 * root - 1.0), 1.0 / root, np.where(inner, 0.0, -0.5 / root**3))
        )
    return np.stack((np.log1p(z), 1.0 / (1.0 + z), -1.0 / (1.0 + z) ** 2))


def of_data_alone(loss: Loss, apart: int) -> Any:
    """Return the loss for SciPy; the last rows, what is known beforehand, count by their squares.

    Parameters
    ----------
    apart
        Number of these rows.
    """
    if loss == "linear" or not apart:
        return loss

    def mixed(z: Array) -> Array:
        return np.hstack((rho(z[:-apart], loss), rho(z[-apart:], "linear")))

    return mixed


def influence(r: Array, loss: Loss) -> tuple[Array, Array]:
    r"""Return :math:`\psi(r) = r \rho'(r^2)` and its derivative by r, each of shape (n,).

    Half the loss of :math:`z = r^2` is minimized: :math:`\psi` is its derivative by r.

    References
    ----------
    P. J. Huber, Robust Statistics, 1981, section 3.2.
    """
    _, first, second = rho(r**2, loss)
    return r * first, first + 2.0 * r**2 * second


def bread(slopes: Array, unknowns: int) -> float:
    r"""Return what divides an M-estimate's scores, :math:`E[\psi'] / K`.

    :math:`K = 1 + (p/n) \operatorname{var}(\psi') / E[\psi']^2` corrects for few residuals; the
    covariance is :math:`K^2 \, [\sum \psi^2 / (n-p)] / E[\psi']^2 \, (J^T J)^{-1}`.

    Parameters
    ----------
    slopes
        Derivatives of the influence by the residual, shape (n,).
    unknowns
        p.

    References
    ----------
    P. J. Huber, Robust Statistics, 1981, section 7.6.
    """
    # A redescending loss whose residuals are mostly outliers has no minimum worth a name.
    mean = max(float(slopes.mean()), _LEAST)
    return mean / (1.0 + unknowns / slopes.size * float(slopes.var()) / mean**2)
