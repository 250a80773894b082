"""Drifting parameters of a brake, such as friction or clearance, tracked through a record."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from bywire.core.arguments import checked
from bywire.core.errors import ParameterError, nearest_first, unknown_name
from bywire.core.registry import Kind, instances
from bywire.core.typing import Array
from bywire.identification.output_error import even_interval


@dataclass(frozen=True)
class Rows:
    r"""Samples of a relation :math:`y = \varphi^T \theta`.

    Parameters
    ----------
    regressors, targets
        Shapes (n, p) and (n,); NaN where the relation does not hold.
    """

    regressors: Array
    targets: Array


@dataclass(frozen=True)
class Relation:
    """A relation that determines parameters.

    Parameters
    ----------
    name
        Name of the relation.
    assembly
        Assembly whose parameters it determines.
    names, units
        All parameters of the relation, the tracked one first, and their SI units.
    signals
        Required signals: name -> SI unit.
    rows
        ``rows(data, par) -> Rows``.
    start
        ``start(par) -> values``, shape (p,).
    assumption
        Condition for its validity, one sentence.
    """

    name: str
    assembly: str
    names: tuple[str, ...]
    units: tuple[str, ...]
    signals: Mapping[str, str]
    rows: Callable[[xr.Dataset, Any], Rows]
    start: Callable[[Any], Array]
    assumption: str

    @property
    def parameter(self) -> str:
        """Dotted name of the parameter that it tracks."""
        return self.names[0]


RELATIONS = Kind("relation", ("tracked",), instances(Relation))
"""in order of preference: the first one of a parameter whose signals are measured is used"""


def _find_relation(name: str, data: xr.Dataset, par: Any) -> Relation:
    """Return the relation that determines a parameter from the measured signals.

    Parameters
    ----------
    name
        Dotted name, or its last part.
    data
        Measured signals.
    par
        Parameters of the brake.

    Raises
    ------
    UnknownNameError
        When no relation determines such a parameter.
    ParameterError
        When a required signal is not measured, or the relation is for another brake.
    """
    known = {relation.parameter for relation in RELATIONS.all().values()}
    relations = [
        r for r in RELATIONS.all().values() if name in (r.parameter, r.parameter.rpartition(".")[2])
    ]
    if not relations:
        raise unknown_name("parameter to track", name, known)
    relations = [r for r in relations if r.parameter in par.flat()]
    if not relations:
        raise ParameterError(
            f"{name} is not a parameter of this brake. Use a brake with this parameter", name=name
        )
    for relation in relations:
        if all(signal in data for signal in relation.signals):
            return relation
    wanted = " or ".join(", ".join(r.signals) for r in relations)
    raise ParameterError(
        f"tracking {relations[0].parameter} needs the measured signals {wanted}. The data contain "
        f"{nearest_first(map(str, data.data_vars), relations[0].signals)}",
        name=relations[0].parameter,
    )


# --- Recursive least squares: parameters of a linear relation, sample by sample
# The relation is :math:`y_k = \varphi_k^T \theta_k + e_k`. Either the parameters are a random walk
# that a Kalman filter tracks, or past samples are forgotten exponentially.

_BURN_IN = 3  # samples per unknown that determine the start and do not test the model


@dataclass(frozen=True)
class Walk:
    """Drift of the parameters, and noise of the relation.

    Parameters
    ----------
    drift
        Growth of each parameter's standard deviation per square root of a second, shape (p,).
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
        Prediction error of each sample divided by its standard deviation, shape (n,); NaN for
        unused samples. White and about one if the model is right.
    spreads
        Variance of each sample about its prediction, shape (n,).
    """

    values: Array
    deviations: Array
    innovations: Array
    spreads: Array

    def consistency(self) -> tuple[float, float]:
        """Return mean square and lag-one correlation of the innovations, ideally 1 and 0."""
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
    r"""Track parameters that follow a random walk.

    .. math::
        \theta_{k+1} = \theta_k + w_k,\ \mathrm{cov}(w) = \mathrm{diag}(q^2) T; \quad
        K = P \varphi / (\varphi^T P \varphi + \sigma^2)

    Parameters
    ----------
    regressors, targets
        Shapes (n, p) and (n,); samples with NaN are not used, but the parameters keep drifting.
    interval
        Sample time T [s].
    walk
        q and sigma.
    start, deviation
        Values and standard deviations before the first sample, shape (p,).

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
    r"""Track parameters by least squares with forgetting, weight :math:`e^{-(t_n - t_k) / \tau}`.

    The deviations are those of the weighted least squares, :math:`\sigma^2 S^{-1} S_2 S^{-1}` with
    :math:`S = \sum w \varphi \varphi^T` and :math:`S_2 = \sum w^2 \varphi \varphi^T`, for
    parameters that are constant within the memory; they do not include faster drift.

    Parameters
    ----------
    regressors, targets
        Shapes (n, p) and (n,); samples with NaN are not used, and nothing is forgotten then.
    interval
        Sample time [s].
    memory
        Time constant tau [s].

    Returns
    -------
    Tracked
        NaN until the samples determine all parameters.
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
    r"""Return the maximum-likelihood drift and noise.

    Maximum likelihood of the innovations, :math:`\min \sum \ln s_k + \nu_k^2 / s_k`; the drifts of
    all parameters are one factor times their initial deviations.

    Parameters
    ----------
    least
        Known part of the noise, for example from the scatter within averaged blocks. Otherwise a
        walk with occasional jumps would explain all noise as drift.

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
            f"{int(counts.sum())} valid samples are too few to track {p} parameters. Measure "
            "longer, or under conditions in which the relation is valid",
            name="samples",
            value=str(int(counts.sum())),
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
            f"the shapes of regressors {regressors.shape}, targets {targets.shape} and start "
            f"{start.shape} are inconsistent. They must be (n, p), (n,) and (p,)"
        )


# --- Through a record

_UNSURE = 0.5  # of the start: initial standard deviation of the parameters
_MOST = 4000  # blocks
_BLOCK, _LONGEST = 0.1, 1.0  # s


@dataclass(frozen=True)
class Track:
    """A tracked parameter.

    Parameters
    ----------
    relation
        Relation of the tracking.
    data
        ``value``, ``low``, ``high`` (95 %) over ``time`` [s] and ``parameter``; ``used``: number of
        samples for each value.
    drift, noise
        Maximum likelihood: growth of each parameter per square root of a second, and the standard
        deviation of the relation.
    consistency
        Mean square and lag-one correlation of the normalized innovations, ideally 1 and 0.
    """

    relation: Relation
    data: xr.Dataset
    drift: Array
    noise: float
    consistency: tuple[float, float]


@checked
def track(name: str, data: xr.Dataset, par: Any, block: float | None = None) -> Track:
    """Track a parameter.

    Samples are averaged over blocks, so that sensor lag and disc runout do not correlate
    neighbors. Drift and noise are maximum-likelihood estimates.

    Parameters
    ----------
    name
        Dotted name of the parameter, or its last part.
    data
        Measured signals over ``time`` [s], evenly spaced.
    par
        Parameters of the brake; the tracked one starts at its value there, known to 50 %.
    block
        Length of a block [s]; by default one disc revolution if ``Omega`` is measured, otherwise
        0.1 s; longer if a record would have more than 4000 blocks.

    Raises
    ------
    UnknownNameError, ParameterError
        When no relation determines the parameter, or too little is measured.
    """
    relation = _find_relation(name, data, par)
    interval = even_interval(data["time"].values)
    span = float(data["time"].values[-1] - data["time"].values[0])
    wanted = _turn(data) if block is None else block
    width = max(round(max(wanted, span / _MOST) / interval), 1)
    all_rows = relation.rows(data, par)
    rows, used = _blocks(all_rows, width)
    start = relation.start(par)
    deviation = _UNSURE * np.abs(start)
    step = width * interval
    least = _scatter(all_rows, width, used)
    walk = likeliest(rows.regressors, rows.targets, step, start, deviation, least)
    tracked = kalman(rows.regressors, rows.targets, step, walk, start, deviation)
    times = data["time"].values[0] + (np.arange(used.size) + 0.5) * step
    return Track(
        relation,
        _dataset(relation, times, tracked, used),
        walk.drift,
        walk.noise,
        tracked.consistency(),
    )


def _turn(data: xr.Dataset) -> float:
    """Return the median time of a disc revolution [s]."""
    speed = float(np.nanmedian(np.abs(data["Omega"].values))) if "Omega" in data else 0.0
    return min(2.0 * math.pi / speed, _LONGEST) if speed > 0.0 else _BLOCK


def _blocks(rows: Rows, width: int) -> tuple[Rows, NDArray[np.int64]]:
    """Return means over blocks; NaN where less than half of a block is valid."""
    count = rows.targets.size // width
    phi = rows.regressors[: count * width].reshape(count, width, -1)
    y = rows.targets[: count * width].reshape(count, width)
    there = np.isfinite(y) & np.isfinite(phi).all(axis=2)
    used = there.sum(axis=1)
    enough = used >= max(math.ceil(0.5 * width), 1)
    divisor = np.maximum(used, 1)
    mean_phi = np.where(there[:, :, None], phi, 0.0).sum(axis=1) / divisor[:, None]
    mean_y = np.where(there, y, 0.0).sum(axis=1) / divisor
    mean_phi[~enough], mean_y[~enough] = np.nan, np.nan
    return Rows(mean_phi, mean_y), np.where(enough, used, 0)


def _scatter(rows: Rows, width: int, used: NDArray[np.int64]) -> float:
    """Return the standard error of a block's mean from the scatter within blocks."""
    p = rows.regressors.shape[1]
    variances = []
    for k in np.flatnonzero(used > 2 * p):
        part = slice(k * width, (k + 1) * width)
        y, phi = rows.targets[part], rows.regressors[part]
        there = np.isfinite(y) & np.isfinite(phi).all(axis=1)
        left = y[there] - phi[there] @ np.linalg.lstsq(phi[there], y[there], rcond=None)[0]
        variances.append(float(left @ left) / (there.sum() - p) / there.sum())
    return math.sqrt(float(np.median(variances))) if variances else 0.0


def _dataset(
    relation: Relation, times: Array, tracked: Tracked, used: NDArray[np.int64]
) -> xr.Dataset:
    reach = 1.959964 * tracked.deviations
    axes = ("time", "parameter")
    return xr.Dataset(
        {
            "value": (axes, tracked.values),
            "low": (axes, tracked.values - reach),
            "high": (axes, tracked.values + reach),
            "used": ("time", used),
        },
        {
            "time": ("time", times, {"units": "s"}),
            "parameter": list(relation.names),
            "unit": ("parameter", list(relation.units)),
        },
    )
