"""An equation of motion averaged over windows of steady motion: what reversals do stays outside.

A filter mixes what lies within its reach, and near a reversal dry friction takes any value; a mean
over a window has no reach beyond it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise

import numpy as np
import xarray as xr

from bywire.core.errors import ParameterError
from bywire.core.parameters import ParameterSet
from bywire.core.typing import Array
from bywire.identification.equation import Equation, EquationError
from bywire.identification.estimate import Estimate
from bywire.identification.least_squares import Problem, estimate
from bywire.identification.output_error import even_interval
from bywire.identification.unknown import Unknown

_FEWEST = 4  # samples of a window


@dataclass(frozen=True)
class Window:
    """Samples of steady motion.

    ``rows``: which samples; ``motion``: number of the motion, from one reversal to the next, that
    they belong to.
    """

    rows: slice
    motion: int


def windows(
    omega: Array, interval: float, slowest: float, margin: float, length: float
) -> list[Window]:
    """Return windows within the motions of a signal.

    ``omega``: speed, shape (n,); ``interval``: sample time [s]; ``slowest``: speed that a motion
    keeps; ``margin``: time left out at either end of a motion [s]; ``length``: time of a window
    [s].
    """
    way = np.where(np.abs(omega) > slowest, np.sign(omega), 0.0)
    edges = np.flatnonzero(np.diff(np.concatenate(([0.0], way, [0.0]))))
    skip, size = round(margin / interval), max(round(length / interval), _FEWEST)
    steady, motion = [], 0
    for begin, end in pairwise(edges):
        count = (end - begin - 2 * skip) // size
        if way[begin] == 0.0 or count < 1:
            continue
        steady += [
            Window(slice(begin + skip + k * size, begin + skip + (k + 1) * size), motion)
            for k in range(int(count))
        ]
        motion += 1
    return steady


@dataclass(frozen=True)
class Motions:
    """What was measured of one body, and the windows of it that count.

    ``data``: states, memories and the rate of the equation, over ``time`` [s]; ``windows``: where
    they are averaged.
    """

    data: xr.Dataset
    windows: Sequence[Window]

    def means(self, values: Array) -> Array:
        """Return means over the windows, shape (windows, ...)."""
        return np.array([values[w.rows].mean(axis=0) for w in self.windows])


def motions(data: xr.Dataset, speed: str, slowest: float, margin: float, length: float) -> Motions:
    """Return a measurement with its windows; see :func:`windows`."""
    interval = even_interval(data["time"].values)
    return Motions(data, windows(data[speed].values, interval, slowest, margin, length))


def window_residuals(
    equation: Equation, par: ParameterSet, unknowns: Sequence[Unknown], moved: Motions
) -> Problem:
    """Return the equation's error, averaged over windows, as a problem of least squares."""
    error = EquationError(equation, par, unknowns)
    rows = np.concatenate([np.arange(w.rows.start, w.rows.stop) for w in moved.windows])
    size = [w.rows.stop - w.rows.start for w in moved.windows]
    starts = np.concatenate(([0], np.cumsum(size)[:-1]))
    columns = error.columns(moved.data)[:, rows]

    def evaluate(values: Array) -> tuple[Array, Array]:
        e, W = error(columns, values)
        each = np.array(size, dtype=float)
        return np.add.reduceat(e, starts) / each, np.add.reduceat(W, starts) / each[:, None]

    return Problem(tuple(unknowns), evaluate)


def steady_dynamics(parts: Sequence[Problem], unknowns: Sequence[Unknown], advice: str) -> Estimate:
    """Solve the averaged equations of several bodies for what they share.

    Every part counts by its own scatter, which a first fit tells.

    ``parts``: as ``window_residuals`` gives them, all of the same unknowns; ``advice``: which
    experiment would tell more.

    Raises
    ------
    ParameterError
        When there is too little motion, or nothing is told.
    """
    weights = np.ones(len(parts))
    try:
        for _ in range(2):
            best = estimate(Problem(tuple(unknowns), partial(_weighted, parts, weights)))
            values = {u.label: u.start for u in unknowns} | dict(
                zip(best.names, best.values.tolist(), strict=True)
            )
            final = np.array([values[u.label] for u in unknowns])
            weights = np.array([1.0 / _scatter(p.evaluate(final)[0]) for p in parts])
        return estimate(Problem(tuple(unknowns), partial(_weighted, parts, weights)))
    except ParameterError as error:
        raise ParameterError(f"{error}: {advice}") from None


def _weighted(parts: Sequence[Problem], weights: Array, values: Array) -> tuple[Array, Array]:
    rows = [part.evaluate(values) for part in parts]
    return (
        np.concatenate([w * e for w, (e, _) in zip(weights, rows, strict=True)]),
        np.vstack([w * W for w, (_, W) in zip(weights, rows, strict=True)]),
    )


def _scatter(e: Array) -> float:
    return max(float(np.sqrt(np.mean(e**2))), 1e-300)
