"""Exact linear models of any model that follows the protocol, by algorithmic differentiation."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import cache
from itertools import combinations
from typing import Any, Literal, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from bywire.analysis.linear.corners import Jacobians, Linearization, linear_models, magnitudes
from bywire.analysis.linear.linear_model import LinearModel
from bywire.analysis.linear.smooth_functions import (
    SmoothFunctions,
    SmoothPoint,
    smooth_functions,
    vector,
)
from bywire.core.arguments import checked
from bywire.core.errors import ParameterError, unknown_name
from bywire.core.model import Model
from bywire.core.parameters import ParameterSet
from bywire.core.signals import signals_of, zeros
from bywire.core.typing import Array

Friction = Literal["removed", "sliding", "stuck"]
_TOUCH = 1e-12  # overlap or gap [m] below which a contact is treated as neither closed nor open


@checked
def linearize(
    model: Model,
    par: ParameterSet,
    state: NamedTuple,
    memory: NamedTuple,
    *,
    inputs: Sequence[str],
    outputs: Sequence[str],
    friction: Friction | Mapping[str, Friction] = "removed",
) -> LinearModel:
    r"""Return the Jacobians of a model's smooth part at an operating point.

    .. math:: m_k(x) \dot x_k = f_k(x, u) \;\Rightarrow\;
        A_{kj} = \partial (f_k / m_k) / \partial x_j

    Valid for small motions in which no contact opens or closes, away from one-sided limits.
    Closed contacts act with their stiffness and damping. Dry friction is set-valued and has no
    derivative at rest. A stop operator within its width follows its motion. At its width, it slips
    outward and follows inward, so it needs a side, "above" or "below".

    Parameters
    ----------
    model, par
        The system and its parameters.
    state, memory
        Operating point: the model's State, and the Memory of the tasks.
    inputs
        Fields of Memory that drive the continuous part, for example ``("i_source",)``.
    outputs
        Fields of Output or State; if both have a field of that name, the one of Output.
    friction
        ``"removed"``: without friction. ``"sliding"``: for motion about steady sliding, the force
        in the sliding direction with its slope; every velocity with friction must be nonzero.
        ``"stuck"``: every velocity with friction stays zero. Alternatively, one of these for each
        velocity, by name; friction of other velocities is removed.

    Raises
    ------
    UnknownNameError
        When an input, an output or a velocity with friction is unknown.
    ParameterError
        When a contact just touches, a friction is at rest with ``friction="sliding"``, or moves
        with ``"stuck"``.
    CornerError
        When the point lies on a kink of an operation (a limit, a dead band, a magnitude)
        whose sides have different models, and no side is specified; see `corners.taking`.

    Notes
    -----
    The Jacobian is exact, since ``x`` and the protocol's value-only ``xe`` are the same here.
    """
    _require_known("input", inputs, model.Memory._fields)
    require_outputs(model, outputs)
    point = smooth_point(model, par, (state, memory, None), friction)
    free = free_signals(point, model.State._fields, inputs, ())
    return linear_models(
        Linearization(
            point,
            free,
            lambda at: jacobians(at, at.plant(), outputs, free),
            lambda at: (plant_model(at, inputs, outputs),),
            outputs=bool(outputs),
            ticks=False,
        )
    )[0]


def smooth_point(
    model: Model,
    par: ParameterSet,
    at: tuple[NamedTuple, NamedTuple, NamedTuple | None],
    friction: Friction | Mapping[str, Friction] = "removed",
) -> SmoothPoint:
    """Return an operating point with its closed contacts and the treatment of dry friction.

    Parameters
    ----------
    at
        State, Memory and Stimulus; None for a stimulus of zeros.

    Raises
    ------
    UnknownNameError, ParameterError
        As `linearize`.
    """
    state, memory, stimulus = at
    K = _stiffness(model, smooth_functions(model, par), state, vector(par))
    given = zeros(cast(Any, model.Stimulus)) if stimulus is None else stimulus
    x, m, u = (np.array([float(v) for v in values]) for values in (state, memory, given))
    return SmoothPoint(model, par, x, m, u, K, *_frictions(model, state, friction))


def free_signals(
    point: SmoothPoint, states: Sequence[str], memory: Sequence[str], stimulus: Sequence[str]
) -> NDArray[np.bool_]:
    """Return a mask of the listed fields that do not stick, over state, memory and stimulus."""
    model = point.model
    rows = zip((*model.frictions, *model.stops), point.moving, strict=True)
    stuck = [name for name, g in rows if not g]
    moving = {*states} - {*stuck}
    pairs = ((model.State, moving), (model.Memory, memory), (model.Stimulus, stimulus))
    return np.array([name in free for kind, free in pairs for name in kind._fields], dtype=bool)


def jacobians(
    point: SmoothPoint,
    plant: Sequence[Array],
    outputs: Sequence[str],
    free: NDArray[np.bool_],
    ticks: Sequence[Sequence[Array]] = (),
) -> Jacobians:
    """Return the matrices of a linear model with respect to its free signals; see `Jacobians`."""
    model = point.model
    A, B, C, D, rate, y = plant
    C, D = _rows(model, outputs, C, D)
    kept = [model.Output._fields.index(name) for name in outputs if name in model.Output._fields]
    values = [rate[:, 0], np.zeros(len(outputs))]
    recorded = [k for k, name in enumerate(outputs) if name in model.Output._fields]
    values[1][recorded] = y[kept, 0]
    nothing = np.zeros((len(A) + len(outputs), point.stimulus.size))
    rows = [np.hstack([np.vstack([A, C]), np.vstack([B, D]), nothing])]
    names = [*model.State._fields, *("" for _ in outputs)]
    for M_x, M_m, M_u, renewed in ticks:
        rows.append(np.hstack([M_x, M_m, M_u]))
        values.append(renewed[:, 0])
        names += [f"{name}[k]" for name in model.Memory._fields]
    slopes = np.vstack(rows)[:, free] * magnitudes(point)[free]
    return Jacobians(slopes, np.concatenate(values), tuple(names))


def plant_model(point: SmoothPoint, inputs: Sequence[str], outputs: Sequence[str]) -> LinearModel:
    """Return the Jacobians of the smooth part at a point, which may lie on a kink."""
    model = point.model
    A, B, C, D, rate, _ = point.plant()
    C, D = _rows(model, outputs, C, D)
    columns = [model.Memory._fields.index(name) for name in inputs]
    B, D = B[:, columns], D[:, columns]
    states, held = signals_of(model.State), signals_of(model.Memory)
    known = states | signals_of(model.Output)
    return LinearModel(
        model.name,
        A,
        B,
        C,
        D,
        tuple(states),
        tuple(inputs),
        tuple(outputs),
        tuple(signal.unit for signal in states.values()),
        tuple(held[name].unit for name in inputs),
        tuple(known[name].unit for name in outputs),
        rate[:, 0],
    )


def _rows(model: Model, outputs: Sequence[str], C: Array, D: Array) -> tuple[Array, Array]:
    """Return the rows of the outputs; a state that is not recorded is its own output."""
    recorded, states = model.Output._fields, model.State._fields
    rows, direct = np.zeros((len(outputs), len(states))), np.zeros((len(outputs), D.shape[1]))
    for k, name in enumerate(outputs):
        if name in recorded:
            rows[k], direct[k] = C[recorded.index(name)], D[recorded.index(name)]
        else:
            rows[k, states.index(name)] = 1.0
    return rows, direct


def _frictions(
    model: Model, state: NamedTuple, friction: Friction | Mapping[str, Friction]
) -> tuple[list[float], list[float]]:
    """Return every friction's direction (0 if removed), and 0 for each velocity that sticks.

    Stop operators follow their motions.
    """
    if isinstance(friction, str):
        friction = dict.fromkeys(model.frictions, friction)
    _require_known("velocity with friction", tuple(friction), model.frictions)
    directions = [0.0 for _ in model.frictions]
    moving = [1.0 for _ in (*model.frictions, *model.stops)]
    for k, name in enumerate(model.frictions):
        kind = friction.get(name, "removed")
        if kind == "sliding":
            directions[k] = math.copysign(1.0, _direction(name, state))
        elif kind == "stuck":
            _require_rest(name, state)
            moving[k] = 0.0
    return directions, moving


def _direction(name: str, state: NamedTuple) -> float:
    speed = float(getattr(state, name))
    if speed == 0.0:
        raise ParameterError(
            f"{name} = 0 is not valid, because friction at rest has no derivative. Specify a "
            "sliding speed, or use friction='removed'",
            name=name,
            value="0",
            valid="a sliding speed",
        )
    return speed


def _require_rest(name: str, state: NamedTuple) -> None:
    speed = float(getattr(state, name))
    if speed != 0.0:
        raise ParameterError(
            f"{name} = {speed:g} is not valid, because a moving state is not stuck. Use "
            "friction='sliding'",
            name=name,
            value=f"{speed:g}",
            valid="0",
        )


def _stiffness(
    model: Model, functions: SmoothFunctions, state: NamedTuple, p: list[float]
) -> Array:
    """Return the stiffness of the contacts that are closed at a state, zero for open ones."""
    values = functions.contacts(list(state), p)
    *matrices, gaps = map(np.array, values if isinstance(values, tuple) else (values,))
    whole, at = np.zeros((sum(map(len, matrices)),) * 2), 0
    for C in matrices:
        d = gaps[at : at + len(C), 0]
        left, slack, K = _active(C, d)
        if left < _TOUCH:
            raise ParameterError(
                f"{model.name}: contact {at + int(np.argmin(slack))} is just touching at the "
                "operating point. Choose a point at which it is clearly open or closed",
                name="contact",
            )
        whole[at : at + len(C), at : at + len(C)] = K
        at += len(C)
    return whole


def closed_contacts(model: Model, par: ParameterSet, state: NamedTuple) -> list[int]:
    """Return the contacts that are closed at a state, numbered through all groups.

    Raises
    ------
    ParameterError
        When a contact just touches.
    """
    K = _stiffness(model, smooth_functions(model, par), state, vector(par))
    return np.flatnonzero(K.diagonal()).tolist()


def _active(C: Array, d: Array) -> tuple[float, Array, Array]:
    """Return the result for a group's closed contacts: the subset with the largest minimum slack.

    Returns
    -------
    tuple
        Minimum slack, overlap or gap of each contact [m], and stiffness of the closed contacts.
    """
    stiffness = C.diagonal()
    # Closed contacts must press, open ones gap: the subset that satisfies both has positive slack.
    best: tuple[float, Array, Array] = (-math.inf, d, C)
    for closed in _subsets(len(d)):
        K = np.zeros_like(C)
        if closed.size:
            K[closed[:, None], closed] = np.linalg.inv(C[closed[:, None], closed])
        F = K @ d
        slack = C @ F - d
        slack[closed] = (stiffness * F)[closed]
        least = float(slack.min())
        if least > best[0]:
            best = (least, slack, K)
    return best


@cache
def _subsets(n: int) -> tuple[NDArray[np.intp], ...]:
    chosen = (s for size in range(n + 1) for s in combinations(range(n), size))
    return tuple(np.array(s, dtype=np.intp) for s in chosen)


def require_outputs(model: Model, outputs: Sequence[str]) -> None:
    """Reject names that are neither outputs nor states.

    Raises
    ------
    UnknownNameError
        With the nearest known names.
    """
    _require_known("output", outputs, (*model.State._fields, *model.Output._fields))


def _require_known(kind: str, names: Sequence[str], known: Sequence[str]) -> None:
    for name in names:
        if name not in known:
            raise unknown_name(kind, name, known)


# --- Operating points at which nothing accelerates, by Newton's method from a start nearby

_TURNS = 30
_SETTLED = 1e-10  # of a signal's usual magnitude: negligible step
_LEFT = 1e-6  # of the rate that one usual magnitude of any signal causes: above it, no equilibrium


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
        Start of the search.
    given
        States that keep their value and therefore determine the equilibrium. So do stop operators.
    inputs
        Fields of Memory that may change to hold the system there.
    running
        States that keep their value and may have a rate, for example a disc's angle.
    tied
        States with the same unit that keep their differences, for example two angles with a
        preload between them.
    friction
        As in `linearize`.

    Raises
    ------
    ParameterError
        When there is no equilibrium near the start, or a contact just touches during the search.

    Notes
    -----
    If there are several equilibria, the result is the one with the smallest change, where usual
    magnitudes scale the signals.
    """
    known = signals_of(model.State) | signals_of(model.Memory)
    fixed = (*given, *running, *tied[1:], *model.stops)
    free = [k for k, name in enumerate(model.State._fields) if name not in fixed]
    still = [k for k, name in enumerate(model.State._fields) if name not in running]
    names = [*(model.State._fields[k] for k in free), *inputs]
    size = np.array([known[name].nominal for name in names])
    for _ in range(_TURNS):
        # On a kink, any side is suitable, because the search only crosses it.
        at = plant_model(smooth_point(model, par, (state, memory, None), friction), inputs, ())
        A = at.A.copy()
        if tied:
            columns = [model.State._fields.index(name) for name in tied]
            A[:, columns[0]] = A[:, columns].sum(axis=1)
        J = np.hstack([A[np.ix_(still, free)], at.B[still]]) * size
        weight = np.maximum(np.abs(J).max(axis=1), np.finfo(float).tiny)
        left = at.rate[still] / weight
        # Least norm: rigid motions (a preload without friction) have no unique equilibrium.
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
            f"{model.name} has no equilibrium near the operating point, because {name} does not "
            "come to rest. Choose another operating point",
            name=name,
        )
    return state, memory


def _moved(values: NamedTuple, by: dict[str, float]) -> NamedTuple:
    return values._replace(
        **{name: getattr(values, name) + by[name] for name in values._fields if name in by}
    )
