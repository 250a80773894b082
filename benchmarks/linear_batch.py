"""Exact linear models at many operating points at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations
from typing import Any, cast

import numpy as np

from bywire.analysis.linear.smooth_functions import smooth_functions, vector
from bywire.core.errors import ParameterError, unknown_name
from bywire.core.model import Model
from bywire.core.parameters import ParameterSet
from bywire.core.typing import Array


@dataclass(frozen=True, eq=False)
class LinearBatch:
    """Jacobians of a model's continuous part at many points, without dry friction.

    Parameters
    ----------
    A, B, C, D
        Shapes (points, n, n), (points, n, nu), (points, ny, n), (points, ny, nu), in SI units.
    rate
        dx/dt at the points, shape (points, n).
    """

    A: Array
    B: Array
    C: Array
    D: Array
    rate: Array


def linearize_many(
    model: Model,
    par: ParameterSet,
    states: Array,
    memories: Array,
    *,
    inputs: Sequence[str],
    outputs: Sequence[str],
) -> LinearBatch:
    """Return the result of ``linearize`` for many operating points of one parameter set.

    ``model``, ``par``: the system and its parameters; ``states``, ``memories``: operating points,
    shapes (points, n) and (points, nm), in the order of State and Memory; ``inputs``: fields of
    Memory; ``outputs``: fields of Output.

    Raises
    ------
    UnknownNameError
        If an input or output is unknown.
    ParameterError
        If the shapes do not match.

    Notes
    -----
    A contact that just touches counts as open.
    """
    for kind, names, known in (
        ("input", inputs, model.Memory._fields),
        ("output", outputs, model.Output._fields),
    ):
        for name in names:
            if name not in known:
                raise unknown_name(kind, name, known)
    count = len(states)
    valid = (count, len(model.State._fields)), (count, len(model.Memory._fields))
    if (states.shape, memories.shape) != valid:
        raise ParameterError(
            f"states and memories have the shapes {states.shape} and {memories.shape}, but they "
            f"must have {valid[0]} and {valid[1]}"
        )
    functions, p = smooth_functions(model, par), np.array(vector(par))
    repeated = np.repeat(p[None], count, axis=0)
    *matrices, d = _mapped(functions.contacts, count, (states, repeated))
    K = _stiffness([matrix[0] for matrix in matrices], d[:, :, 0])
    frictions = np.zeros((count, len(model.frictions)))
    A, B, C, D, rate, _ = _mapped(
        functions.plant, count, (states, memories, repeated, K, frictions, frictions + 1.0)
    )
    columns = [model.Memory._fields.index(name) for name in inputs]
    rows = [model.Output._fields.index(name) for name in outputs]
    return LinearBatch(A, B[:, :, columns], C[:, rows], D[:, rows][:, :, columns], rate[:, :, 0])


@lru_cache(8)
def _map(function: Any, count: int) -> Any:
    return function.map(count)


def _mapped(function: Any, count: int, values: Sequence[Array]) -> list[Array]:
    """Evaluate at all points, from (points, ...) to (points, rows, columns).

    The function uses buffers, because converting CasADi matrices costs more time than computing the
    Jacobians.
    """
    mapped = _map(function, count)
    buffer, evaluate = mapped.buffer()
    results = []
    kept = [np.ascontiguousarray(np.moveaxis(v, 1, -1)).ravel() for v in values]  # by columns
    for k, flat in enumerate(kept):
        buffer.set_arg(k, memoryview(cast(Any, flat)))
    for k in range(function.n_out()):
        rows, columns = function.size_out(k)
        result = np.zeros((count, columns, rows))
        buffer.set_res(k, memoryview(cast(Any, result.reshape(-1))))
        results.append(result)
    evaluate()
    return [np.moveaxis(result, 1, 2) for result in results]


def _stiffness(matrices: Sequence[Array], d: Array) -> Array:
    """Return the stiffness of the closed contacts, shape (points, contacts, contacts)."""
    K, at = np.zeros((*d.shape, d.shape[1])), 0
    for C in matrices:
        n = len(C)
        block = slice(at, at + n)
        stiffnesses, tests = [], []
        for closed in (list(s) for size in range(n + 1) for s in combinations(range(n), size)):
            part = np.zeros((n, n))
            part[np.ix_(closed, closed)] = np.linalg.inv(C[np.ix_(closed, closed)])
            test = C @ part - np.eye(n)
            test[closed] = (np.diag(C)[:, None] * part)[closed]
            stiffnesses.append(part)
            tests.append(test)
        slack = np.einsum("sij,pj->psi", np.array(tests), d[:, block]).min(axis=2)
        K[:, block, block] = np.array(stiffnesses)[slack.argmax(axis=1)]
        at += n
    return K
