"""Equation error: an equation of motion with measured signals, solved for parameters."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from threading import Lock
from typing import TYPE_CHECKING, NamedTuple

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from bywire.core.errors import ModelError, ParameterError, unknown_name
from bywire.core.model import Model
from bywire.core.parameters import ParameterSet
from bywire.core.typing import Array
from bywire.identification.confidence import MisfitWarning, misfit, notes_of, uncertainty
from bywire.identification.differentiation import low_passed
from bywire.identification.estimate import Estimate, Part
from bywire.identification.least_squares import Problem, estimate
from bywire.identification.measured import require_signals
from bywire.identification.output_error import even_interval
from bywire.identification.unknown import Unknown
from bywire.simulation.native import BufferedCall
from bywire.simulation.symbols import SX, column, scalars

if TYPE_CHECKING:
    import xarray as xr


@dataclass(frozen=True)
class Equation:
    """One equation of a model, ``mass dx/dt = balance + friction``, over measured signals.

    Parameters
    ----------
    model
        The model.
    state
        Name of the state whose equation it is.
    rate
        Measured signal that is its derivative.
    slowest
        Speed below which a body with dry friction is treated as reversing [unit of the state].
    unit
        Unit of the equation, for residuals: ``"N*m"`` of a torque balance.
    """

    model: Model
    state: str
    rate: str
    slowest: float = 0.0
    unit: str = "1"


class EquationError:
    """Error of the equation and its derivatives with respect to the unknowns, for each sample."""

    def __init__(self, equation: Equation, par: ParameterSet, unknowns: Sequence[Unknown]) -> None:
        model = equation.model
        if equation.state not in model.State._fields:
            raise ModelError(
                f"{model.name} has no state {equation.state}. Its states are "
                f"{', '.join(model.State._fields)}",
                name="state",
                value=equation.state,
                valid=", ".join(model.State._fields),
            )
        k = model.State._fields.index(equation.state)
        leaves = par.leaves()
        theta = SX.sym("theta", len(unknowns))
        symbolic = dict(leaves)
        for u, s in zip(unknowns, scalars(theta), strict=True):
            if u.name not in leaves:
                raise unknown_name("parameter", u.name, tuple(leaves))
            symbolic[u.name] = s
        symbols = par.with_leaves(symbolic)
        x, m = SX.sym("x", len(model.State._fields)), SX.sym("m", len(model.Memory._fields))
        rate = SX.sym("rate")
        state, memory = model.State(*scalars(x)), model.Memory(*scalars(m))
        free = tuple(0.0 for group in model.compliance(par) for _ in group)
        balance = model.balance(state, state, memory, symbols, free)[k]
        e = model.mass(state, symbols)[k] * rate - balance
        if equation.state in model.frictions:
            bounds = model.bounds(state, state, memory, symbols, free)
            low, high = bounds[model.frictions.index(equation.state)]
            e = e - ca.if_else(state[k] > 0, low, high)
        e = column((e,))
        self._names = [*model.State._fields, *model.Memory._fields, equation.rate]
        inputs = ca.vertcat(x, m, rate)
        pattern = set(ca.jacobian_sparsity(e, inputs).get_triplet()[1])
        self._needed = [name for k, name in enumerate(self._names) if k in pattern]
        slopes = ca.densify(ca.jacobian(e, theta))
        self._function = ca.Function("e", [inputs, theta], [ca.densify(e), slopes])
        self._calls: dict[int, BufferedCall] = {}  # by number of samples
        self._lock = Lock()  # one thread at a time may use a call's buffers

    def columns(self, data: xr.Dataset) -> Array:
        """Return the measured inputs of the equation, shape (inputs, n); zero if unused."""
        require_signals(data, self._needed)
        count = data.sizes["time"]
        rows = [data[n].values if n in self._needed else np.zeros(count) for n in self._names]
        return np.array(rows)

    def at(
        self, state: Sequence[float], memory: NamedTuple, varied: str, values: Sequence[float]
    ) -> Array:
        """Return the inputs of the equation at rest, with one value of the memory varied.

        Parameters
        ----------
        varied
            Name of a field of the memory.
        values
            Shape (n,).
        """
        rows = [(*state, *memory._replace(**{varied: value}), 0.0) for value in values]
        return np.array(rows).T

    def __call__(self, columns: Array, values: Array) -> tuple[Array, Array]:
        """Return the error and its derivatives, shapes (n,) and (n, p)."""
        n = columns.shape[1]
        with self._lock:
            if n not in self._calls:
                self._calls[n] = BufferedCall(self._function.map(n))
            e, W = self._calls[n](columns.ravel(order="F"), np.tile(values, n))
            return e.copy(), W.reshape(n, len(values)).copy()


# --- Inverse dynamics: solved at every instant
# This needs no run, so it is fast and works from any start. Every signal of the equation must be
# measured, or be a derivative of a measured signal. While the body moves, dry friction has the
# value for its direction; samples near a reversal determine nothing and are excluded.

_ROUNDS, _SETTLED = 50, 1e-12
_DECIMATED = 0.8  # of half the new sample rate: passband of the decimation filter


def inverse_dynamics(
    equation: Equation,
    par: ParameterSet,
    unknowns: Sequence[Unknown],
    data: xr.Dataset,
    *,
    bandwidth: float | None = None,
    instruments: xr.Dataset | None = None,
    weights: Array | None = None,
) -> Estimate:
    r"""Solve an equation of motion for parameters.

    Least squares on :math:`e = m \dot x - balance - friction`; if e is affine in the unknowns,
    this is the linear regression :math:`e = W \pi - y`, which needs no start. With instruments,
    the estimate solves :math:`Z^T e = 0` with Z the derivatives of e along a simulated motion
    without measurement noise: it stays unbiased even if W contains noise.

    Parameters
    ----------
    equation
        Equation to solve.
    par
        Known parameters.
    unknowns
        Parameters to estimate.
    data
        States, memories (controller outputs) and the rate, under the model's names, over
        ``time`` [s], evenly spaced; see ``differentiated``.
    bandwidth
        Frequency up to which the equation is valid [Hz]: residuals are low-passed and decimated
        to about twice that, so that they are independent. None for unfiltered samples.
    instruments
        A simulation of the same experiment, filtered in the same way.
    weights
        Weight of each sample, the inverse of its variance up to a factor, shape (n,); equal by
        default.

    Raises
    ------
    UnknownNameError
        When the equation needs a signal that is not measured.
    ParameterError
        When too few samples move, or they do not determine the unknowns.
    ModelError
        When the model has no such state.
    """
    evaluate = EquationError(equation, par, unknowns)
    interval = even_interval(data["time"].values)
    keep = _thinned(data, equation, interval, bandwidth)
    seen = evaluate.columns(data)
    other = None if instruments is None else evaluate.columns(instruments)
    root = np.ones(keep.size) if weights is None else np.sqrt(weights[keep])
    values = np.array([u.start for u in unknowns])
    scale = np.array([u.scale for u in unknowns])

    def rows(columns: Array) -> tuple[Array, Array]:
        e, W = evaluate(columns, values)
        table = np.column_stack((e, W * scale))
        if bandwidth is not None:
            table = low_passed(table, interval, bandwidth)
        return table[keep, 0] * root, table[keep, 1:] * root[:, None]

    for _ in range(_ROUNDS):
        e, W = rows(seen)
        if len(e) <= len(values):
            raise ParameterError(
                f"only {len(e)} samples are faster than {equation.slowest:g}, which is too few for "
                f"{len(values)} unknowns. Record more motion, or reduce the slowest speed",
                name="slowest",
                value=f"{equation.slowest:g}",
            )
        Z = W if other is None else rows(other)[1]
        _require_told(W, unknowns)
        if other is None:
            change = np.linalg.lstsq(W, e, rcond=None)[0]
        else:
            change = np.linalg.solve(Z.T @ W, Z.T @ e)
        values = values - change * scale
        if np.abs(change).max() < _SETTLED * max(1.0, np.abs(values / scale).max()):
            break
    e, W = rows(seen)
    Z = W if other is None else rows(other)[1]
    sure = uncertainty(W, e, instruments=None if other is None else Z)
    estimate = Estimate(
        unknowns=tuple(unknowns),
        values=values,
        covariance=sure.covariance * np.outer(scale, scale),
        singular_values=np.asarray(np.linalg.svd(W, compute_uv=False), dtype=float),
        residuals=e / np.where(root > 0.0, root, 1.0),
        freedom=sure.freedom,
        colored=sure.colored,
        parts=(
            Part(
                f"equation of {equation.state}",
                "",
                len(e),
                equation.unit,
                spread=float(np.std(W @ (values / scale) - e)),
            ),
        ),
    )
    if wrong := misfit(estimate):
        warnings.warn(wrong, MisfitWarning, stacklevel=2)
    return estimate.noted(notes_of(estimate))


def _require_told(W: Array, unknowns: Sequence[Unknown]) -> None:
    """Reject data that do not depend on a combination of the unknowns."""
    size = np.linalg.norm(W, axis=0)
    silent = [u.label for u, s in zip(unknowns, size, strict=True) if s == 0.0]
    if silent:
        raise ParameterError(
            f"the data do not determine {', '.join(silent)} because no signal that depends on it "
            "moves. Excite it, or treat it as known",
            name=", ".join(silent),
        )
    _, s, V = np.linalg.svd(W / size, full_matrices=False)  # the full U is n by n
    if s[-1] < 1e-10 * s[0]:
        together = [u.label for u, v in zip(unknowns, V[-1], strict=True) if abs(v) > 0.1]
        raise ParameterError(
            f"the data determine only a combination of {', '.join(together)}. Treat one of them as "
            "known, or excite them separately",
            name=", ".join(together),
        )


def _thinned(
    data: xr.Dataset, equation: Equation, interval: float, bandwidth: float | None
) -> NDArray[np.int64]:
    """Return the valid samples: decimated, away from reversals and from the ends."""
    count = data.sizes["time"]
    every = 1
    margin = 0
    if bandwidth is not None:
        every = max(int(_DECIMATED / (2.0 * bandwidth * interval)), 1)
        margin = min(int(1.0 / (bandwidth * interval)), count // 20)
    index = np.arange(3 * margin, count - 3 * margin, every)
    if equation.state in equation.model.frictions:
        slow = np.abs(data[equation.state].values) <= equation.slowest
        mixed = np.ones(2 * margin + 1)  # reach of the filter
        near = np.convolve(slow, mixed, mode="same") > 0.5
        index = index[~near[index]]
    return index


# --- Steady motion: averages over windows without reversals
# A filter mixes samples within its reach, and near a reversal dry friction may have any value. A
# mean over a window does not reach beyond it.

_FEWEST = 4  # samples of a window


@dataclass(frozen=True)
class Window:
    """Samples of steady motion.

    ``rows``: indices of the samples; ``motion``: number of the motion between two reversals that
    contains them.
    """

    rows: slice
    motion: int


def windows(
    omega: Array, interval: float, slowest: float, margin: float, length: float
) -> list[Window]:
    """Return windows within the motions of a signal.

    ``omega``: speed, shape (n,); ``interval``: sample time [s]; ``slowest``: minimum speed of a
    motion; ``margin``: time excluded at each end of a motion [s]; ``length``: length of a window
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
    """A measurement of one body with its valid windows.

    ``data``: states, memories and the rate of the equation, over ``time`` [s]; ``windows``: for
    the averages.
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
    """Solve the averaged equations of several bodies for their common parameters.

    The scatter of each part in a first fit determines its weight.

    ``parts``: results of ``window_residuals`` for the same unknowns; ``advice``: a more
    informative experiment.

    Raises
    ------
    ParameterError
        When there is too little motion, or the data determine nothing.
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
        raise ParameterError(f"{error}. {advice}") from None


def _weighted(parts: Sequence[Problem], weights: Array, values: Array) -> tuple[Array, Array]:
    rows = [part.evaluate(values) for part in parts]
    return (
        np.concatenate([w * e for w, (e, _) in zip(weights, rows, strict=True)]),
        np.vstack([w * W for w, (_, W) in zip(weights, rows, strict=True)]),
    )


def _scatter(e: Array) -> float:
    return max(float(np.sqrt(np.mean(e**2))), 1e-300)
