"""Uncertainty of least-squares estimates, from the Jacobian and the residuals."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_LEVEL = 0.01  # of the test whether residuals are white


@dataclass(frozen=True)
class Uncertainty:
    """How sure a least-squares estimate is.

    Parameters
    ----------
    covariance
        Shape (p, p).
    freedom
        Independent residuals less unknowns.
    colored
        Whether neighboring residuals go together.
    """

    covariance: Array
    freedom: float
    colored: bool


def uncertainty(
    jacobian: Array, residuals: Array, instruments: Array | None = None, prior_rows: int = 0
) -> Uncertainty:
    r"""Return the covariance of a least-squares estimate.

    White residuals: :math:`s^2 (J^T J)^{-1}`. Where neighbors go together, the sandwich
    :math:`(J^T J)^{-1} J^T \Gamma J (J^T J)^{-1}` with the autocovariance :math:`\Gamma` of an
    autoregressive model of the residuals; fewer of them then count as independent.

    Parameters
    ----------
    jacobian
        d(residual)/d(unknown), shape (n, p).
    residuals
        Shape (n,), in the order in which they were measured.
    instruments
        Of an instrumental-variable estimate, shape (n, p); the Jacobian by default.
    prior_rows
        Last rows that are prior knowledge, with a standard deviation of one by construction.
    """
    n, p = jacobian.shape
    data = slice(0, n - prior_rows)
    Z = jacobian if instruments is None else instruments
    bread = np.linalg.pinv(Z.T @ jacobian)
    r, Zd = residuals[data], Z[data]
    freedom = max(n - p, 1)
    known = Z[n - prior_rows :].T @ Z[n - prior_rows :]
    colored = not is_white(r)
    if not colored:
        middle = float(residuals @ residuals) / freedom * (Zd.T @ Zd)
        return Uncertainty(bread @ (middle + known) @ bread.T, float(freedom), False)
    model = autoregression(r)
    spread = _filtered(Zd[::-1], model.coefficients)
    middle = model.variance * (spread.T @ spread)
    independent = min(n * float(np.mean(r**2)) / model.at_zero_frequency, float(n))
    left = max(independent - p, 1.0)
    middle = middle * (independent / left)
    return Uncertainty(bread @ (middle + known) @ bread.T, left, True)


@dataclass(frozen=True)
class Autoregression:
    """Residuals as white noise through :math:`1 / (1 + a_1 z^{-1} + ...)`.

    Parameters
    ----------
    coefficients
        1, a_1, ..., shape (order + 1,).
    variance
        Of the white noise.
    """

    coefficients: Array
    variance: float

    @property
    def at_zero_frequency(self) -> float:
        """Sum of the autocovariance over all lags."""
        return float(self.variance / np.sum(self.coefficients) ** 2)


def autoregression(residuals: Array) -> Autoregression:
    """Return the autoregressive model of a signal, its order by Schwarz's criterion."""
    from scipy import linalg

    n = residuals.size
    most = max(min(int(10.0 * np.log10(n)), n // 10), 1)
    rho = autocorrelation(residuals, most)
    power = float(np.mean(residuals**2))
    best, lowest = Autoregression(np.ones(1), power), np.inf
    for order in range(1, most + 1):
        a = -linalg.solve_toeplitz(rho[:order], rho[1 : order + 1])
        variance = power * max(float(1.0 + a @ rho[1 : order + 1]), 1e-12)
        criterion = n * np.log(variance) + order * np.log(n)
        if criterion < lowest:
            best, lowest = Autoregression(np.concatenate(([1.0], a)), variance), criterion
    return best


def _filtered(columns: Array, coefficients: Array) -> Array:
    """Return columns through the noise's filter, until it has died away."""
    from scipy import signal

    tail = np.zeros((min(len(columns), 50 * len(coefficients)), columns.shape[1]))
    return np.asarray(signal.lfilter([1.0], coefficients, np.vstack((columns, tail)), axis=0))


def autocorrelation(residuals: Array, lags: int) -> Array:
    """Return the autocorrelation at the lags 0 .. lags, shape (lags + 1,)."""
    r = residuals - residuals.mean()
    size = 1 << (2 * r.size - 1).bit_length()
    spectrum = np.fft.rfft(r, size)
    found = np.fft.irfft(spectrum * spectrum.conj(), size)[: lags + 1]
    return np.asarray(found / found[0]) if found[0] > 0 else np.eye(1, lags + 1)[0]


def is_white(residuals: Array, lags: int = 20) -> bool:
    """Return whether neighbors do not go together (Ljung and Box 1978, level 1 %)."""
    from scipy import stats

    n = residuals.size
    lags = min(lags, n // 4)
    if lags < 1:
        return True
    rho = autocorrelation(residuals, lags)[1:]
    statistic = n * (n + 2) * float(np.sum(rho**2 / (n - np.arange(1, lags + 1))))
    return bool(stats.chi2.sf(statistic, lags) > _LEVEL)
