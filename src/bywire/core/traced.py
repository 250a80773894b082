"""Numbers that record their computation, so that single equations of a model can be evaluated.

The equations of a model run once on `Traced` numbers. Each result can then be evaluated on the rows
of a recording, without the rest of the model.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np


class Traced:
    """Number that is defined by its name or by its computation.

    Parameters
    ----------
    operation
        Operation that computes the number; None for a named number.
    inputs
        Operands, or the name of a named number.
    """

    __slots__ = ("inputs", "operation")
    __array_ufunc__ = None  # NumPy numbers delegate operations to this class

    def __init__(self, operation: Callable[..., Any] | None, *inputs: Any) -> None:
        self.operation, self.inputs = operation, inputs

    def _bywire_op(self, name: str, *inputs: Any) -> Traced:
        return Traced(getattr(np, name), *inputs)

    def __bool__(self) -> bool:
        raise TypeError("a traced number has no value without rows")


def _forward(operation: Callable[..., Any]) -> Callable[..., Traced]:
    return lambda *inputs: Traced(operation, *inputs)


def _backward(operation: Callable[..., Any]) -> Callable[..., Traced]:
    return lambda second, first: Traced(operation, first, second)


_BOTH = ("add", "sub", "mul", "truediv", "pow", "and", "or", "mod", "floordiv")
for _name in (*_BOTH, "neg", "pos", "abs", "lt", "le", "gt", "ge", "eq", "ne"):
    _operation = getattr(operator, f"__{_name}__")
    setattr(Traced, f"__{_name}__", _forward(_operation))
    if _name in _BOTH:
        setattr(Traced, f"__r{_name}__", _backward(_operation))


def names_in(values: Any, marks: Mapping[int, Any] | None = None) -> Iterator[Any]:
    """Yield the names that a value, or a tuple of values, depends on.

    ``marks``: objects to yield instead of the names, by the identity of the traced numbers.
    """
    waiting, seen = [values], set()
    while waiting:
        each = waiting.pop()
        if isinstance(each, tuple):
            waiting += each
        elif isinstance(each, Traced) and id(each) not in seen:
            seen.add(id(each))
            if marks and id(each) in marks:
                yield marks[id(each)]
            elif each.operation is None:
                yield each.inputs[0]
            else:
                waiting += each.inputs


def computed(values: Any, operands: Mapping[str, Any]) -> Any:
    """Evaluate a value, or a tuple of values, with operands by name."""
    return _computed(values, operands, {})


def _computed(each: Any, operands: Mapping[str, Any], known: dict[int, Any]) -> Any:
    """Return a value; ``known`` caches the results of shared operations by their identity."""
    # A nested function would refer to itself and keep recordings in memory until garbage
    # collection.
    if isinstance(each, tuple):
        rows = [_computed(inner, operands, known) for inner in each]
        return each._make(rows) if hasattr(each, "_make") else tuple(rows)
    if not isinstance(each, Traced):
        return each
    if each.operation is None:
        return operands[each.inputs[0]]
    if id(each) not in known:
        inputs = [_computed(inner, operands, known) for inner in each.inputs]
        known[id(each)] = each.operation(*inputs)
    return known[id(each)]
