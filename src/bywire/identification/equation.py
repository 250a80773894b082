"""One equation of a model over measured signals: its error, and the derivatives of that."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from threading import Lock
from typing import NamedTuple

import casadi as ca
import numpy as np
import xarray as xr

from bywire.core.errors import ModelError, unknown_name
from bywire.core.model import Model
from bywire.core.parameters import ParameterSet
from bywire.core.typing import Array
from bywire.identification.records import require_signals
from bywire.identification.unknown import Unknown
from bywire.simulation.buffered_call import BufferedCall
from bywire.simulation.symbols import SX, column, scalars


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
        Speed below which a body with dry friction counts as turning round [unit of the state].
    unit
        Of the equation, for what it leaves: ``"N*m"`` of a torque balance.
    """

    model: Model
    state: str
    rate: str
    slowest: float = 0.0
    unit: str = "1"


class EquationError:
    """The equation's error and its derivatives by the unknowns, sample by sample."""

    def __init__(self, equation: Equation, par: ParameterSet, unknowns: Sequence[Unknown]) -> None:
        model = equation.model
        if equation.state not in model.State._fields:
            raise ModelError(
                f"{model.name} has no state {equation.state}: it has "
                f"{', '.join(model.State._fields)}"
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
        self._calls: dict[int, BufferedCall] = {}  # by how many samples
        self._lock = Lock()  # a call's buffers serve one at a time

    def columns(self, data: xr.Dataset) -> Array:
        """Return the measured inputs of the equation, shape (inputs, n); zero where unread."""
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
