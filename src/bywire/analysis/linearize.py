"""Exact linear models of any model of the protocol: Jacobians by algorithmic differentiation."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal, NamedTuple, cast

import numpy as np

from bywire.analysis.linear_model import LinearModel
from bywire.core.errors import ParameterError, unknown_name
from bywire.core.model import Model
from bywire.core.parameters import ParameterSet
from bywire.core.signals import signals_of, zeros
from bywire.simulation.contacts import active_set

Friction = Literal["removed", "sliding", "stuck"]
_TOUCH = 1e-12  # overlap or gap [m] below which a contact counts as neither closed nor open


def linearize(
    model: Model,
    par: ParameterSet,
    state: NamedTuple,
    memory: NamedTuple,
    *,
    inputs: Sequence[str],
    outputs: Sequence[str],
    friction: Friction = "removed",
) -> LinearModel:
    r"""Return the Jacobians of a model's smooth part at an operating point.

    .. math:: m_k(x) \dot x_k = f_k(x, u) \;\Rightarrow\;
        A_{kj} = \partial (f_k / m_k) / \partial x_j

    Valid for small motions in which no contact opens or closes, and off the one-sided limits.
    Closed contacts act with their stiffness and damping. Dry friction is set-valued and has no
    derivative at rest.

    Parameters
    ----------
    model, par
        The system and its parameters.
    state, memory
        Operating point: the model's State, and the Memory that the tasks hold.
    inputs
        Fields of Memory that drive the continuous part, for instance ``("i_source",)``.
    outputs
        Fields of Output or State; where both have one of that name, what is recorded.
    friction
        ``"removed"``: as if there were none. ``"sliding"``: for motion about steady sliding, the
        force of the sliding direction with its slope; every friction's velocity must be nonzero.
        ``"stuck"``: every velocity with friction stays zero.

    Raises
    ------
    UnknownNameError
        When an input or output is unknown.
    ParameterError
        When a contact just touches, a friction is at rest with ``friction="sliding"``, or moves
        with ``"stuck"``.

    Notes
    -----
    The Jacobian is exact: ``x`` and the value-only ``xe`` of the protocol are the same here.
    """
    _require_known("input", inputs, model.Memory._fields)
    _require_known("output", outputs, (*model.State._fields, *model.Output._fields))
    A, B, C, D, rate = _jacobians(model, par, state, memory, inputs, outputs, friction)
    states, held = signals_of(model.State), signals_of(model.Memory)
    known = states | signals_of(model.Output)
    return LinearModel(
        model.name, A, B, C, D,
        tuple(states), tuple(inputs), tuple(outputs),
        tuple(signal.unit for signal in states.values()),
        tuple(held[name].unit for name in inputs),
        tuple(known[name].unit for name in outputs),
        rate[:, 0],
    )  # fmt: skip


def _jacobians(
    model: Model,
    par: ParameterSet,
    state: NamedTuple,
    memory: NamedTuple,
    inputs: Sequence[str],
    outputs: Sequence[str],
    friction: Friction,
) -> list[Any]:
    """Return A, B, C, D, and the rate as a column."""
    import casadi as ca

    x, u = ca.SX.sym("x", len(state)), ca.SX.sym("u", len(inputs))
    held = memory._replace(**dict(zip(inputs, ca.vertsplit(u), strict=True)))
    at = cast(Any, model.State)(*ca.vertsplit(x))
    rate, y = _smooth(model, par, at, held, outputs, state, friction)
    parts = [ca.jacobian(a, b) for a in (rate, y) for b in (x, u)]
    jacobians = ca.Function("jacobians", [x, u], [*parts, rate])
    values = jacobians(list(state), [getattr(memory, name) for name in inputs])
    return [np.array(value, dtype=float) for value in values]


def _smooth(
    model: Model,
    par: ParameterSet,
    x: Any,
    held: Any,
    outputs: Sequence[str],
    state: NamedTuple,
    friction: Friction,
) -> tuple[Any, Any]:
    """Return rates and outputs as symbols."""
    import casadi as ca

    contact = _contact_forces(model, par, state, x)
    force = dict(zip(x._fields, model.balance(x, x, held, par, contact), strict=True))
    reaction = [0.0] * (len(model.frictions) + len(model.limits))
    if friction == "sliding":
        bounds = model.bounds(x, x, held, par, contact)
        for k, (name, (low, high)) in enumerate(zip(model.frictions, bounds, strict=True)):
            reaction[k] = low if _direction(name, state) > 0 else high
            force[name] = force[name] + reaction[k]
    if friction == "stuck":
        for name in model.frictions:
            _require_rest(name, state)
            force[name] = 0.0 * force[name]
    mass = model.mass(x, par)
    rate = ca.vertcat(*(force[name] / getattr(mass, name) for name in x._fields))
    flow = zeros(cast(Any, model.Flow))
    out = model.output(x, held, par, contact, tuple(reaction), flow)
    y = [getattr(out if name in out._fields else x, name) for name in outputs]
    return rate, ca.vertcat(*y)


def _direction(name: str, state: NamedTuple) -> float:
    speed = float(getattr(state, name))
    if speed == 0.0:
        raise ParameterError(
            f"{name} = 0: friction at rest has no slope; give a sliding speed, or use "
            "friction='removed'"
        )
    return speed


def _require_rest(name: str, state: NamedTuple) -> None:
    speed = float(getattr(state, name))
    if speed != 0.0:
        raise ParameterError(f"{name} = {speed:g}: what moves is not stuck; use friction='sliding'")


def _contact_forces(
    model: Model, par: ParameterSet, state: NamedTuple, x: Any
) -> tuple[Any, ...]:
    """Return the forces of all contacts as symbols, for the contacts closed at ``state``."""
    import casadi as ca

    forces: list[Any] = []
    matrices = model.compliance(par)
    gaps, moving = model.gap(state, state, par), model.gap(x, x, par)
    for C, d, depth in zip(matrices, gaps, moving, strict=True):
        stiffness = active_set(ca.SX(ca.DM(C)), ca.SX(ca.DM([float(one) for one in d]))).stiffness
        K = np.array(ca.DM(ca.evalf(stiffness)))
        F = K @ np.array(d, dtype=float)
        left = np.where(F > 0, np.diag(C) * F, np.array(C) @ F - np.array(d, dtype=float))
        if np.min(left) < _TOUCH:
            k = len(forces) + int(np.argmin(left))
            raise ParameterError(
                f"{model.name}: contact {k} just touches at the operating point: choose a point "
                "at which it is clearly open or closed"
            )
        forces += ca.vertsplit(ca.DM(K) @ ca.vertcat(*depth))
    return tuple(forces)


def _require_known(kind: str, names: Sequence[str], known: Sequence[str]) -> None:
    for name in names:
        if name not in known:
            raise unknown_name(kind, name, known)
