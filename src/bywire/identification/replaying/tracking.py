"""Track a drifting parameter of a brake through a record."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from bywire.core.arguments import checked
from bywire.core.typing import Array
from bywire.identification.output_error import even_interval
from bywire.identification.replaying.recursive import Tracked, kalman, likeliest
from bywire.identification.replaying.relation import Relation, Rows, find_relation

_UNSURE = 0.5  # of the start: how far off the parameters may be at first
_MOST = 4000  # blocks
_BLOCK, _LONGEST = 0.1, 1.0  # s


@dataclass(frozen=True)
class Track:
    """A tracked parameter.

    Parameters
    ----------
    relation
        What it was tracked from.
    data
        ``value``, ``low``, ``high`` (95 %) over ``time`` [s] and ``parameter``; ``used``: samples
        behind each value.
    drift, noise
        Found likeliest: what each parameter gains in the square root of a second, and the
        standard deviation of the relation.
    consistency
        Mean square and lag-one correlation of the normalized innovations: 1 and 0 when right.
    """

    relation: Relation
    data: xr.Dataset
    drift: Array
    noise: float
    consistency: tuple[float, float]


@checked
def track(name: str, data: xr.Dataset, par: Any, block: float | None = None) -> Track:
    """Track a parameter.

    Samples are averaged over blocks, so that the sensor's lag and the disc's run-out do not make
    neighbors depend on each other; drift and noise are those that make the blocks likeliest.

    Parameters
    ----------
    name
        Dotted name of the parameter, or its last part.
    data
        Measured signals over ``time`` [s], evenly spaced.
    par
        Parameters of the brake; what is tracked starts at its value there, known to 50 %.
    block
        Length of a block [s]; by default a turn of the disc where ``Omega`` is measured, else
        0.1 s; longer where a record would have more than 4000.

    Raises
    ------
    UnknownNameError, ParameterError
        When nothing tells the parameter, or too little is measured.
    """
    relation = find_relation(name, data, par)
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
    """Return how long the disc takes for a turn [s], the median of the record."""
    speed = float(np.nanmedian(np.abs(data["Omega"].values))) if "Omega" in data else 0.0
    return min(2.0 * math.pi / speed, _LONGEST) if speed > 0.0 else _BLOCK


def _blocks(rows: Rows, width: int) -> tuple[Rows, NDArray[np.int64]]:
    """Return means over blocks; NaN where less than half of a block counts."""
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
    """Return the standard error of a block's mean that the scatter within blocks tells."""
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
