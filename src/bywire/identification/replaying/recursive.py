r"""Slowly drifting parameters of a linear relation, tracked sample by sample.

The relation is :math:`y_k = \varphi_k^T \theta_k + e_k`. Either the parameters walk at random and
a Kalman filter follows them, or past samples are forgotten exponentially.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from bywire.core.errors import ParameterError
from bywire.core.typing import Array

_BURN_IN = 3  # samples per unknown that set the start rather than test the model


@dataclass(frozen=True)
class Walk:
    """How parameters may drift, and how noisy the relation is.

    Parameters
    ----------
    drift
        Standard deviation that each parameter gains in the square root of a second, shape (p,).
    noise
        Standard deviation of e.
    """

    drift: Array
    noise: float


@dataclass(frozen=True)
class Tracked:
    """Parameters over time.

    Parameters
    ----------
    values, deviations
        Estimates and their standard deviations after each sample, shape (n, p).
    innovations
        What each sample said against the prediction, over the standard deviation of that, shape
        (n,); NaN where a sample did not count. White and of size one where the model is right.
    spreads
        Variance of each sample about its prediction, shape (n,).
    """

    values: Array
    deviations: Array
    innovations: Array
    spreads: Array

    def consistency(self) -> tuple[float, float]:
        """Return mean square and lag-one correlation of the innovations: 1 and 0 when right."""
        nu = self.innovations[np.isfinite(self.innovations)]
        square = float(np.mean(nu**2)) if nu.size else math.nan
        if nu.size < 3 or not square > 0.0:
            return square, math.nan
        return square, float(np.mean(nu[1:] * nu[:-1]) / square)


def kalman(
    regressors: Array,
    targets: Array,
    interval: float,
    walk: Walk,
    start: Array,
    deviation: Array,
) -> Tracked:
    r"""Track parameters that walk at random.

    .. math::
        \theta_{k+1} = \theta_k + w_k,\ \mathrm{cov}(w) = \mathrm{diag}(q^2) T; \quad
        K = P \varphi / (\varphi^T P \varphi + \sigma^2)

    Parameters
    ----------
    regressors, targets
        Shapes (n, p) and (n,); a sample with NaN tells nothing, and the parameters walk on.
    interval
        Sample time T [s].
    walk
        q and sigma.
    start, deviation
        What is known before the first sample, shape (p,).

    References
    ----------
    Ljung, System Identification (1999), section 11.3: the covariance in Joseph's form.
    """
    _require_shapes(regressors, targets, start)
    theta, P = start.astype(float).copy(), np.diag(deviation.astype(float) ** 2)
    Q, variance = np.diag(walk.drift**2) * interval, walk.noise**2
    n, p = regressors.shape
    values, sure = np.empty((n, p)), np.empty((n, p))
    innovations, spreads = np.full(n, np.nan), np.full(n, np.nan)
    identity = np.eye(p)
    counts = np.isfinite(targets) & np.isfinite(regressors).all(axis=1)
    for k in range(n):
        if k:
            P = P + Q
        if counts[k]:
            phi = regressors[k]
            spread = float(phi @ P @ phi) + variance
            gain = P @ phi / spread
            error = float(targets[k] - phi @ theta)
            theta = theta + gain * error
            left = identity - np.outer(gain, phi)
            P = left @ P @ left.T + variance * np.outer(gain, gain)
            innovations[k], spreads[k] = error / math.sqrt(spread), spread
        values[k], sure[k] = theta, np.sqrt(np.diag(P))
    return Tracked(values, sure, innovations, spreads)


def forgetting(regressors: Array, targets: Array, interval: float, memory: float) -> Tracked:
    r"""Track parameters by least squares that forgets, weight :math:`e^{-(t_n - t_k) / \tau}`.

    The deviations are those of the weighted least squares, :math:`\sigma^2 S^{-1} S_2 S^{-1}` with
    :math:`S = \sum w \varphi \varphi^T` and :math:`S_2 = \sum w^2 \varphi \varphi^T`, as if the
    parameters stood still within the memory: drift faster than that is not in them.

    Parameters
    ----------
    regressors, targets
        Shapes (n, p) and (n,); a sample with NaN tells nothing, and nothing is forgotten then.
    interval
        Sample time [s].
    memory
        Time constant tau [s].

    Returns
    -------
    Tracked
        NaN until the samples tell all parameters.
    """
    n, p = regressors.shape
    _require_shapes(regressors, targets, np.zeros(p))
    keep = math.exp(-interval / memory)
    S, S2, r = np.zeros((p, p)), np.zeros((p, p)), np.zeros(p)
    squares, weights, squared_weights = 0.0, 0.0, 0.0
    values, sure = np.full((n, p), np.nan), np.full((n, p), np.nan)
    innovations, spreads = np.full(n, np.nan), np.full(n, np.nan)
    counts = np.isfinite(targets) & np.isfinite(regressors).all(axis=1)
    for k in range(n):
        if counts[k]:
            phi, y = regressors[k], float(targets[k])
            S = keep * S + np.outer(phi, phi)
            S2 = keep**2 * S2 + np.outer(phi, phi)
            r = keep * r + phi * y
            squares = keep * squares + y * y
            weights, squared_weights = keep * weights + 1.0, keep**2 * squared_weights + 1.0
        size = np.sqrt(np.diag(S))
        if np.all(size > 0.0) and np.linalg.cond(S / np.outer(size, size)) < 1e10:
            inverse = np.linalg.inv(S)
            theta = inverse @ r
            effective = weights**2 / squared_weights
            if effective > p:
                left = max(squares - float(theta @ r), 0.0) / weights
                variance = left * effective / (effective - p)
                cov = variance * inverse @ S2 @ inverse
                sure[k] = np.sqrt(np.maximum(np.diag(cov), 0.0))
                if counts[k] and k and np.isfinite(values[k - 1]).all() and variance > 0.0:
                    before = targets[k] - regressors[k] @ values[k - 1]
                    innovations[k], spreads[k] = float(before) / math.sqrt(variance), variance
            values[k] = theta
        elif k:
            values[k], sure[k] = values[k - 1], sure[k - 1]
    return Tracked(values, sure, innovations, spreads)


def likeliest(
    regressors: Array,
    targets: Array,
    interval: float,
    start: Array,
    deviation: Array,
    least: float = 0.0,
) -> Walk:
    r"""Return drift and noise under which the data is likeliest.

    Maximum likelihood of the innovations, :math:`\min \sum \ln s_k + \nu_k^2 / s_k`; the drifts of
    all parameters are one factor times their initial deviations.

    Parameters
    ----------
    least
        Noise that is there for sure, for instance from the scatter within averaged blocks: a
        walk that jumps now and then would otherwise explain all noise as drift.

    Raises
    ------
    ParameterError
        When there are too few samples.

    References
    ----------
    Harvey, Forecasting, Structural Time Series Models and the Kalman Filter (1989), section 3.4.
    """
    from scipy import optimize

    counts = np.isfinite(targets) & np.isfinite(regressors).all(axis=1)
    p = regressors.shape[1]
    if counts.sum() < 10 * p:
        raise ParameterError(
            f"{int(counts.sum())} samples count: too few to track {p} parameters; measure longer, "
            "or where the relation holds"
        )
    W, y = regressors[counts], targets[counts]
    rough = float(np.std(y - W @ np.linalg.lstsq(W, y, rcond=None)[0])) or 1e-9

    def walk(x: Array) -> Walk:
        return Walk(math.exp(x[1]) * deviation, math.hypot(least, rough * math.exp(x[0])))

    def loss(x: Array) -> float:
        tracked = kalman(regressors, targets, interval, walk(x), start, deviation)
        there = np.flatnonzero(np.isfinite(tracked.innovations))[_BURN_IN * p :]
        nu, spread = tracked.innovations[there], tracked.spreads[there]
        return float(np.sum(np.log(spread) + nu**2))

    grid = [(loss(np.array([a, b])), a, b) for a in (-2.0, 0.0) for b in (-8.0, -5.0, -2.0)]
    _, a, b = min(grid)
    ended = optimize.minimize(
        loss,
        np.array([a, b]),
        method="Nelder-Mead",
        options={"xatol": 0.02, "fatol": 1e-3, "maxiter": 80},
    )
    return walk(ended.x)


def _require_shapes(regressors: Array, targets: Array, start: Array) -> None:
    n, p = regressors.shape
    if targets.shape != (n,) or start.shape != (p,):
        raise ParameterError(
            f"shapes do not fit: regressors {regressors.shape}, targets {targets.shape}, start "
            f"{start.shape}; wanted are (n, p), (n,) and (p,)"
        )
