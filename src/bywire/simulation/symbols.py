"""Shims around CasADi's SX, so that the scheme reads like its description."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import casadi as ca

SX = ca.SX


def column(values: Sequence[Any]) -> Any:
    """Return a column of scalars as one SX, also of none."""
    return ca.vertcat(*(SX(v) for v in values)) if values else SX(0, 1)


def scalars(vector: Any) -> tuple[Any, ...]:
    """Return the entries of a column."""
    return tuple(vector[k] for k in range(vector.shape[0]))


def symbol_tuple(tuple_type: type, vector: Any) -> Any:
    """Return a signal tuple filled with the entries of a column."""
    return tuple_type(*scalars(vector))


def nonlinear(expression: Any, variables: Any) -> list[bool]:
    """Return for each variable whether the expression is nonlinear in it."""
    if expression.shape[0] == 0 or variables.shape[0] == 0:
        return [False] * int(variables.shape[0])
    return [bool(b) for b in ca.which_depends(expression, variables, 2, False)]


def depends(expression: Any, variables: Any) -> bool:
    """Return whether an expression contains any of the variables."""
    return bool(ca.depends_on(expression, variables)) if variables.numel() else False
