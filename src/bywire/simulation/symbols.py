"""Thin wrappers around CasADi's SX that keep the scheme readable."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import casadi as ca

SX = ca.SX


def column(values: Sequence[Any]) -> Any:
    """Return scalars as an SX column, which may be empty."""
    return ca.vertcat(*(SX(v) for v in values)) if values else SX(0, 1)


def scalars(vector: Any) -> tuple[Any, ...]:
    """Return the entries of a column."""
    return tuple(ca.vertsplit(vector)) if vector.shape[0] else ()


def symbol_tuple(tuple_type: type, vector: Any) -> Any:
    """Return a signal tuple filled with the entries of a column."""
    return tuple_type(*scalars(vector))


_JUMPS = frozenset(
    (ca.OP_FLOOR, ca.OP_CEIL, ca.OP_SIGN, ca.OP_LT, ca.OP_LE, ca.OP_EQ, ca.OP_NE, ca.OP_NOT)
)
"""operations whose derivative is zero wherever the derivative exists"""


def nonlinear(expression: Any, variables: Any) -> list[bool]:
    """Return whether the expression is nonlinear in each variable, or jumps with it."""
    if expression.shape[0] == 0 or variables.shape[0] == 0:
        return [False] * int(variables.shape[0])
    curved = ca.which_depends(expression, variables, 2, False)
    jumps = _jumping(expression, variables)
    return [bool(bent) or k in jumps for k, bent in enumerate(curved)]


def _jumping(expression: Any, variables: Any) -> set[int]:
    """Return the variables with which an expression jumps, although its derivative is zero."""
    known = {each.element_hash() for each in ca.symvar(variables)}
    others = [each for each in ca.symvar(expression) if each.element_hash() not in known]
    function = ca.Function("jumps", [variables, ca.vertcat(*others)], [ca.densify(expression)])
    codes = range(function.n_instructions())
    if not any(function.instruction_id(k) in _JUMPS for k in codes):
        return set()
    reads: dict[int, frozenset[int]] = {}  # by register number
    found: set[int] = set()
    for k in codes:
        code = function.instruction_id(k)
        if code == ca.OP_OUTPUT:
            continue
        into = function.instruction_output(k)[0]
        if code == ca.OP_INPUT:
            place, entry = function.instruction_input(k)
            reads[into] = frozenset((entry,) if place == 0 else ())
            continue
        sources = function.instruction_input(k) if code != ca.OP_CONST else []
        reads[into] = frozenset().union(*(reads.get(source, frozenset()) for source in sources))
        if code in _JUMPS:
            found |= reads[into]
    return found


def depends(expression: Any, variables: Any) -> bool:
    """Return whether an expression contains any of the variables."""
    return bool(ca.depends_on(expression, variables)) if variables.numel() else False
