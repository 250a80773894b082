"""One substep, symbolically: implicit midpoint with set-valued forces on the velocity level.

The state carries the last increment, from which the midpoint is predicted; bounds of frictions,
geometry and contact sets are taken there, everything that is linear is solved exactly, and what
is nonlinear gets one Newton step. Second order in smooth phases and through stick-slip.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca

from bywire.core.errors import SolverError
from bywire.core.model import Model
from bywire.core.parameters import ParameterSet
from bywire.simulation.contacts import active_set
from bywire.simulation.elimination import Reduced, eliminate
from bywire.simulation.set_valued import Projection, project_exact, project_fast
from bywire.simulation.symbols import SX, column, nonlinear, scalars, symbol_tuple

NEVER = 1e30  # bound of a one-sided limit's reaction


@dataclass(frozen=True)
class Symbols:
    """Arguments of a substep: state, predicted increment, memory, parameters, step."""

    x: Any
    d: Any
    m: Any
    p: Any
    h: Any


@dataclass(frozen=True)
class Pass:
    """Results of one pass through a substep.

    Parameters
    ----------
    x, d
        State at the end and the increment, shape (nx,) each.
    reaction
        Forces of the frictions, then of the limits.
    contact
        Contact forces at the midpoint.
    flow
        Increments of the integrals.
    flag
        1 where the pass must be repeated: a contact set changed, a limit was crossed, or the
        projection of the frictions failed.
    """

    x: Any
    d: Any
    reaction: Any
    contact: Any
    flow: Any
    flag: Any


@dataclass(frozen=True)
class _Linearized:
    """The model's smooth part and its derivatives, evaluated where the substep needs them."""

    f: Any
    J: Any
    nonlinear: list[bool]


def build_pass(model: Model, par: ParameterSet, s: Symbols, exact: bool) -> Pass:
    """Build one pass.

    Parameters
    ----------
    model
        The system.
    par
        Its parameters with the entries of ``s.p`` as numbers.
    s
        Arguments of the pass.
    exact
        False: the pass of nearly every substep, which leaves one-sided limits alone and only
        checks them. True: the repeated pass, with limits and every combination of signs.
    """
    y = s.x + 0.5 * s.d
    K, index = _contact_sets(model, par, y)
    at_y = K @ _gaps(model, par, y, y)
    linear = _linearize(model, par, s, y, K)
    bounds = _bounds(model, par, s, y, at_y)
    mass = column(model.mass(symbol_tuple(model.State, y), par))
    A = ca.diag(mass) - 0.5 * s.h * linear.J
    changed = [k for k, flag in enumerate(linear.nonlinear) if flag]
    r = s.h * linear.f
    if changed:
        r = r - 0.5 * s.h * (linear.J[:, changed] @ s.d[changed])
    kept = _set_valued_states(model, exact)
    reduced = eliminate(A, r, kept, ca.vertcat(s.x, s.d))
    projection, reaction = _project(model, s, reduced, bounds, exact)
    d = _increments(s, reduced, projection)
    x = column([projection.w[kept.index(k)] if k in kept else s.x[k] + d[k]
                for k in range(s.x.shape[0])])
    middle = s.x + 0.5 * d
    contact = K @ _gaps(model, par, middle, y)
    flow = model.powers(
        symbol_tuple(model.State, middle),
        symbol_tuple(model.State, d / s.h),
        symbol_tuple(model.Memory, s.m),
        par,
        scalars(contact),
        scalars(reaction),
    )
    _, index_after = _contact_sets(model, par, middle)
    flag = ca.logic_or(projection.failed, _differ(index, index_after))
    if not exact:
        for name in model.limits:
            flag = ca.logic_or(flag, x[model.State._fields.index(name)] < 0)
    return Pass(x, d, reaction, contact, s.h * column(flow), flag)


def _contact_sets(model: Model, par: ParameterSet, y: Any) -> tuple[Any, list[Any]]:
    """Return the block-diagonal stiffness of all groups and the numbers of the active subsets."""
    state = symbol_tuple(model.State, y)
    blocks, numbers = [], []
    for C, d in zip(model.compliance(par), model.gap(state, state, par), strict=True):
        chosen = active_set(SX(ca.vertcat(*(ca.horzcat(*map(SX, row)) for row in C))), column(d))
        blocks.append(chosen.stiffness)
        numbers.append(chosen.index)
    return (ca.diagcat(*blocks) if blocks else SX(0, 0)), numbers


def _gaps(model: Model, par: ParameterSet, x: Any, xe: Any) -> Any:
    groups = model.gap(symbol_tuple(model.State, x), symbol_tuple(model.State, xe), par)
    return column([d for group in groups for d in group])


def _linearize(model: Model, par: ParameterSet, s: Symbols, y: Any, K: Any) -> _Linearized:
    n = s.x.shape[0]
    x, xe = SX.sym("x_", n), SX.sym("xe_", n)
    force = SX.sym("contact_", K.shape[0])
    state, fixed = symbol_tuple(model.State, x), symbol_tuple(model.State, xe)
    memory = symbol_tuple(model.Memory, s.m)
    f = column(model.balance(state, fixed, memory, par, scalars(force)))
    gap = _gaps(model, par, x, xe)
    if any(nonlinear(gap, x)):
        raise SolverError(f"{model.name}: the overlaps of contacts must be affine in the state")
    curved = nonlinear(f, ca.vertcat(x, force))[:n]
    gap_x = ca.jacobian(gap, x)
    J = ca.jacobian(f, x) + ca.jacobian(f, force) @ K @ gap_x
    at = column([y[k] if curved[k] else s.x[k] for k in range(n)])
    new_force = K @ ca.substitute(gap, ca.vertcat(x, xe), ca.vertcat(at, y))
    f, J = ca.substitute([f, J], [x, xe, force], [at, y, new_force])
    return _Linearized(f, J, curved)


def _bounds(model: Model, par: ParameterSet, s: Symbols, y: Any, contact: Any) -> list[Any]:
    state = symbol_tuple(model.State, y)
    memory = symbol_tuple(model.Memory, s.m)
    pairs = model.bounds(state, state, memory, par, scalars(contact))
    return [(ca.fmin(SX(low), 0), ca.fmax(SX(high), 0)) for low, high in pairs]


def _set_valued_states(model: Model, exact: bool) -> tuple[int, ...]:
    names = model.frictions + (model.limits if exact else ())
    return tuple(model.State._fields.index(name) for name in names)


def _project(
    model: Model, s: Symbols, reduced: Reduced, bounds: list[Any], exact: bool
) -> tuple[Projection, Any]:
    """Return end-of-step values of the set-valued states, and all reactions."""
    limits = [(SX(0), SX(NEVER)) for _ in model.limits]
    pairs = bounds + (limits if exact else [])
    low = s.h * column([p[0] for p in pairs])
    high = s.h * column([p[1] for p in pairs])
    start = s.x[list(reduced.kept)] if reduced.kept else SX(0, 1)
    c = reduced.rhs + reduced.matrix @ start
    projection = (project_exact if exact else project_fast)(reduced.matrix, c, low, high)
    reaction = (reduced.matrix @ projection.w - c) / s.h
    if not exact:
        reaction = ca.vertcat(reaction, SX.zeros(len(model.limits)))
    return projection, reaction


def _increments(s: Symbols, reduced: Reduced, projection: Projection) -> Any:
    known = {k: projection.w[a] - s.x[k] for a, k in enumerate(reduced.kept)}
    every = reduced.back_substitute(known)
    return column([every[k] for k in range(s.x.shape[0])])


def _differ(before: list[Any], after: list[Any]) -> Any:
    different = SX(0)
    for a, b in zip(before, after, strict=True):
        different = ca.logic_or(different, a != b)
    return different
