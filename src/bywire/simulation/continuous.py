"""Plant in continuous time: equations between events, for solvers that locate the events.

Set-valued forces become modes that change only at events. A body with dry friction slides forward
or backward, or sticks until the applied force exceeds the friction bounds. A state with a limit is
similar: its force is any push away from the limit. A contact is closed or open.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca

from bywire.core.model import Model
from bywire.core.parameters import ParameterSet
from bywire.simulation.contacts import gaps, stiffness
from bywire.simulation.scheme import NEVER, solve_small
from bywire.simulation.symbols import SX, column, scalars, symbol_tuple


@dataclass(frozen=True)
class Continuous:
    """A plant's symbolic functions between two events.

    Parameters
    ----------
    modal
        States with a set-valued force: first those with friction, then those with a limit.
    contacts
        Number of contacts.
    closing
        ``(x, p) -> closed``: 1 for each closed contact, else 0.
    equations
        ``(x, m, p, closed) -> (balance, mass, low, high, pressed, lack)``: right-hand sides without
        set-valued forces, and factors of the derivatives, (nx,) each; bounds of the set-valued
        forces; each contact's force if only this contact were closed; and its overlap minus its
        elastic deflection.
    output
        ``(x, m, p, closed, reaction, flow) -> o``: recorded signals; ``flow``: integrals.
    """

    modal: tuple[str, ...]
    contacts: int
    closing: Any
    equations: Any
    output: Any


def build_continuous(model: Model, par: ParameterSet) -> Continuous:
    """Evaluate a plant on symbols.

    Parameters
    ----------
    model
        The system.
    par
        Any parameter set with the required structure. Its numbers become arguments.
    """
    names = tuple(par.leaves())
    p, x = SX.sym("p", len(names)), SX.sym("x", len(model.State._fields))
    symbolic: Any = par.with_leaves(dict(zip(names, scalars(p), strict=True)))
    m = SX.sym("m", len(model.Memory._fields))
    overlap = gaps(model, symbolic, x, x)
    closed = SX.sym("closed", overlap.shape[0])
    modal = (*model.frictions, *model.limits)
    reaction = SX.sym("reaction", len(modal))
    compliance = _compliance(model, symbolic)
    force = _forces(compliance, overlap, closed)
    state, memory = symbol_tuple(model.State, x), symbol_tuple(model.Memory, m)
    pressed = scalars(force)
    pairs = [
        (ca.fmin(SX(low), 0), ca.fmax(SX(high), 0))
        for low, high in model.bounds(state, state, memory, symbolic, pressed)
    ]
    pairs += [(SX(0), SX(NEVER))] * len(model.limits)
    equations = [
        column(model.balance(state, state, memory, symbolic, pressed)),
        column(model.mass(state, symbolic)),
        column([low for low, _ in pairs]),
        column([high for _, high in pairs]),
        column([compliance[k, k] * force[k] for k in range(overlap.shape[0])]),
        overlap - compliance @ force,
    ]
    flow = SX.sym("flow", len(model.Flow._fields))
    integrals = symbol_tuple(model.Flow, flow)
    shown = model.output(state, memory, symbolic, pressed, scalars(reaction), integrals)
    K = stiffness(model, symbolic, overlap, exact=True)
    presses = column([ca.if_else(K[k, k] > 0, 1, 0) for k in range(overlap.shape[0])])
    return Continuous(
        modal,
        overlap.shape[0],
        _function("closing", [x, p], [presses]),
        _function("equations", [x, m, p, closed], equations),
        _function("output", [x, m, p, closed, reaction, flow], [column(shown)]),
    )


def _function(name: str, arguments: list[Any], results: list[Any]) -> Any:
    return ca.Function(name, arguments, [ca.densify(SX(each)) for each in results])


def _compliance(model: Model, par: ParameterSet) -> Any:
    """Return the compliances of all groups, block by block, shape (n, n)."""
    groups = [C for C in model.compliance(par) if C]
    blocks = [SX(ca.vertcat(*(ca.horzcat(*map(SX, row)) for row in C))) for C in groups]
    return ca.densify(ca.diagcat(*blocks)) if blocks else SX(0, 0)


def _forces(C: Any, overlap: Any, closed: Any) -> Any:
    """Return the contact forces F: C F = d for closed contacts, zero for open ones."""
    n = overlap.shape[0]
    if n == 0:
        return SX(0, 1)
    M, b = SX(C), SX(n, 1)
    for k in range(n):
        b[k] = ca.if_else(closed[k], overlap[k], 0)
        for j in range(n):
            if not M[k, j].is_zero():
                M[k, j] = ca.if_else(closed[k], C[k, j], 1.0 if j == k else 0.0)
    return ca.densify(solve_small(M, b))
