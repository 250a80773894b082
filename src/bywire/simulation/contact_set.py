"""The contacts of a model: overlaps, stiffness of those that are closed, and whether they fit."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import casadi as ca

from bywire.core.errors import SolverError
from bywire.core.model import Model
from bywire.core.parameters import ParameterSet
from bywire.simulation.contacts import active_stiffness
from bywire.simulation.symbols import SX, column, nonlinear, symbol_tuple


def contact_forces(model: Model, par: ParameterSet, x: Any) -> Any:
    """Return the forces of all contacts at an instant: what is recorded, not what acts in a step.

    Those of a substep belong to its middle; recorded as they are, they would be half a substep old.
    """
    overlap = gaps(model, par, x, x)
    return stiffness(model, par, overlap, exact=True) @ overlap


def _groups(model: Model, par: ParameterSet, exact: bool) -> list[tuple[Any, slice, bool]]:
    """Return compliances, place among all contacts, and whether the pass takes them as open."""
    matrices, groups, at = model.compliance(par), [], 0
    rarely = model.usually_open or (False,) * len(matrices)
    for C, rare in zip(matrices, rarely, strict=True):
        if not C:
            continue
        rows = SX(ca.vertcat(*(ca.horzcat(*map(SX, row)) for row in C)))
        groups.append((rows, slice(at, at + len(C)), rare and not exact))
        at += len(C)
    return groups


def stiffness(model: Model, par: ParameterSet, d: Any, exact: bool) -> Any:
    """Return the block-diagonal stiffness of the active subsets of all groups, shape (n, n).

    Parameters
    ----------
    d
        Overlaps of all n contacts, shape (n,).
    exact
        False: contacts that are usually open are taken as open.
    """
    blocks = [
        SX(*rows.shape) if is_open else active_stiffness(rows, d[place])
        for rows, place, is_open in _groups(model, par, exact)
    ]
    return ca.diagcat(*blocks) if blocks else SX(0, 0)


def gaps(model: Model, par: ParameterSet, x: Any, xe: Any) -> Any:
    """Return all overlaps at a state, see `overlaps`."""
    return overlaps(model, par)(x, xe)


def overlaps(model: Model, par: ParameterSet) -> Callable[[Any, Any], Any]:
    """Return all overlaps as affine functions of x whose coefficients can be hoisted.

    Returns
    -------
    callable
        Of the state and of where geometry is taken, shape (nx,) each; gives shape (n,).

    Raises
    ------
    SolverError
        When they are not affine in the state.
    """
    n = len(model.State._fields)
    state, fixed = SX.sym("x_", n), SX.sym("xe_", n)
    groups = model.gap(symbol_tuple(model.State, state), symbol_tuple(model.State, fixed), par)
    gap = column([d for group in groups for d in group])
    if any(nonlinear(gap, state)):
        raise SolverError(f"{model.name}: the overlaps of contacts must be affine in the state")
    slope = ca.jacobian(gap, state)
    rest = ca.substitute(gap, state, SX.zeros(n))

    def at(x: Any, xe: Any) -> Any:
        moved, steep = ca.substitute([rest, slope], [fixed], [xe])
        return steep @ x + moved

    return at


def violations(model: Model, par: ParameterSet, d: Any, F: Any, exact: bool) -> list[Any]:
    """Return what is positive where a contact set does not fit the midpoint that came out.

    Forces of the assumed set that push, and overlaps outside it that they close, are the solution:
    there is only one. Cheaper than to choose the set once more.

    Parameters
    ----------
    d, F
        Overlaps and forces of all contacts, shape (n,) each.
    exact
        As in `stiffness`.
    """
    violated: list[Any] = []
    for rows, place, is_open in _groups(model, par, exact):
        overlap, force = d[place], ca.densify(F[place])
        closed = rows @ force
        for k in range(overlap.shape[0]):
            lack = overlap[k] - closed[k]
            # Where a force pushes, the lack is zero but for rounding.
            wrong = ca.if_else(force[k] > 0, 0, ca.fmax(lack, -force[k]))
            violated.append(overlap[k] if is_open else wrong)
    return violated
