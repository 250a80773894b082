"""One operation of an expression graph."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

Node = int
BOOLEAN = frozenset({"lt", "le", "eq", "ne", "not", "and", "or"})
COMMUTATIVE = frozenset({"add", "mul", "eq", "ne", "and", "or", "fmin", "fmax"})


@dataclass(frozen=True)
class Operation:
    """One node: a leaf (``args`` = kind and index), a constant, or an operation on nodes."""

    op: str
    args: tuple[Any, ...]
