"""One operation of an expression graph."""

from __future__ import annotations

from typing import Any, NamedTuple

Node = int
BOOLEAN = frozenset({"lt", "le", "eq", "ne", "not", "and", "or"})
COMMUTATIVE = frozenset({"add", "mul", "eq", "ne", "and", "or", "fmin", "fmax"})


class Operation(NamedTuple):
    """One node: a leaf (``args`` = kind and index), a constant, or an operation on nodes."""

    op: str
    args: tuple[Any, ...]
