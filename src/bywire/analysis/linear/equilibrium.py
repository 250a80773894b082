"""Operating points at which nothing accelerates: found from a start nearby, by Newton's method."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from bywire.analysis.linear.linearize import Friction, plant_model, smooth_point
from bywire.core.errors import ParameterError
from bywire.core.model import Model
from bywire.core.parameters import ParameterSet
from bywire.core.signals import signals_of

_TURNS = 30
_SETTLED = 1e-10  # of a signal's usual magnitude: a step that changes nothing any more
_LEFT = 1e-6  # of the rate that one usual magnitude of anything would make: no equilibrium


def equilibrium(
    model: Model,
    par: ParameterSet,
    state: NamedTuple,
    memory: NamedTuple,
    *,
    given: Sequence[str],
    inputs: Sequence[str],
    running: Sequence[str] = (),
    tied: Sequence[str] = (),
    friction: Friction = "removed",
) -> tuple[NamedTuple, NamedTuple]:
    """Return the nearest state and memory at which no state changes.

    Parameters
    ----------
    model, par
        The system and its parameters.
    state, memory
        Where the search starts.
    given
        States that keep their value: they say which equilibrium is meant.
    inputs
        Fields of Memory that may change: what holds the system there.
    running
        States that keep their value and may go on changing, for instance a disc's angle.
    tied
        States of one unit that keep their differences, for instance two angles and so the
        preload between them.
    friction
        As in `linearize`.

    Raises
    ------
    ParameterError
        When there is no equilibrium near the start, or a contact just touches on the way.

    Notes
    -----
    Where several are as good, the one that changes least is taken, every signal in its usual
    magnitude.
    """
    known = signals_of(model.State) | signals_of(model.Memory)
    fixed = (*given, *running, *tied[1:])
    free = [k for k, name in enumerate(model.State._fields) if name not in fixed]
    still = [k for k, name in enumerate(model.State._fields) if name not in running]
    names = [*(model.State._fields[k] for k in free), *inputs]
    size = np.array([known[name].nominal for name in names])
    for _ in range(_TURNS):
        # On a corner any side will do: the search only passes there.
        at = plant_model(smooth_point(model, par, (state, memory, None), friction), inputs, ())
        A = at.A.copy()
        if tied:
            columns = [model.State._fields.index(name) for name in tied]
            A[:, columns[0]] = A[:, columns].sum(axis=1)
        J = np.hstack([A[np.ix_(still, free)], at.B[still]]) * size
        weight = np.maximum(np.abs(J).max(axis=1), np.finfo(float).tiny)
        left = at.rate[still] / weight
        # Least norm: rigid motions (a preload without friction) have no equilibrium of their own.
        change = np.linalg.lstsq(J / weight[:, None], -left, rcond=1e-12)[0]
        if np.abs(change).max() < _SETTLED:
            break
        moved = dict(zip(names, (change * size).tolist(), strict=True))
        moved |= {name: moved[tied[0]] for name in tied}
        state = _moved(state, moved)
        memory = _moved(memory, moved)
    if np.abs(left).max() > _LEFT:
        name = model.State._fields[still[int(np.argmax(np.abs(left)))]]
        raise ParameterError(
            f"{model.name}: no equilibrium was found near the operating point: {name} does not "
            "come to rest; choose another point"
        )
    return state, memory


def _moved(values: NamedTuple, by: dict[str, float]) -> NamedTuple:
    return values._replace(
        **{name: getattr(values, name) + by[name] for name in values._fields if name in by}
    )
