"""Numbers of several cases, so that Python code runs once for all of them.

Code that takes numbers computes with `Several` as with floats: each operation applies to all cases,
with the result that it has for each float. Where the code branches, all cases must take the same
branch. Otherwise, and for anything else that only a float supports, it raises `DifferError`, and
the code must run for each case. A hash, a format or NumPy function would treat all cases alike, so
that they raise an error too.
"""

from __future__ import annotations

import operator
from collections.abc import Callable
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from bywire.core import ops
from bywire.core.typing import Array


class DifferError(TypeError):
    """Several cases do not take the same branch, or need floats.

    Parameters
    ----------
    text
        Reason.
    where
        Cases that take one of the branches, shape (cases,). None if no case can be computed.
    """

    def __init__(self, text: str, where: NDArray[np.bool_] | None = None) -> None:
        super().__init__(text)
        self.where = where


def _refused(*_: Any) -> NoReturn:
    raise DifferError("this operation needs a single number")


class Truths:
    """Whether a condition holds in each of several cases.

    Parameters
    ----------
    values
        Shape (cases,).
    """

    __slots__ = ("values",)
    __array_ufunc__ = None
    __array__ = _refused
    __hash__ = None  # type: ignore[assignment]

    def __init__(self, values: NDArray[np.bool_]) -> None:
        self.values = values

    def __bool__(self) -> bool:
        first = bool(self.values[0])
        if (self.values != first).any():
            raise DifferError("the cases take different branches", self.values)
        return first

    def _bywire_op(self, name: str, *args: Any) -> Several:
        condition, then, otherwise = args  # only ops.where accepts a condition
        return Several(np.where(condition.values, _values(then), _values(otherwise)))


class Several:
    """A number of each of several cases.

    Parameters
    ----------
    values
        Shape (cases,).
    """

    __slots__ = ("values",)
    __array_ufunc__ = None  # NumPy's numbers delegate operations to this class
    __array__ = __float__ = __int__ = __index__ = __len__ = __iter__ = _refused
    __format__ = __str__ = __repr__ = _refused
    __mod__ = __rmod__ = __floordiv__ = __rfloordiv__ = __round__ = _refused
    __hash__ = None  # type: ignore[assignment]

    def __init__(self, values: Array) -> None:
        self.values = values

    def __bool__(self) -> bool:
        return bool(Truths(self.values != 0.0))

    def __neg__(self) -> Several:
        return Several(-self.values)

    def __pos__(self) -> Several:
        return self

    def __abs__(self) -> Several:
        return Several(np.abs(self.values))

    def __truediv__(self, other: Any) -> Several:
        return _divided(self.values, _values(other))

    def __rtruediv__(self, other: Any) -> Several:
        return _divided(_values(other), self.values)

    def __pow__(self, other: Any) -> Several:
        return _each(operator.pow, self, other)

    def __rpow__(self, other: Any) -> Several:
        return _each(operator.pow, other, self)

    def _bywire_op(self, name: str, *args: Any) -> Several:
        if name == "sqrt" and (args[0].values >= 0.0).all():
            return Several(np.sqrt(args[0].values))
        if name in ("fmax", "fmin"):  # the first one of equal numbers, as for floats
            first, second = map(_values, args)
            is_second = second > first if name == "fmax" else second < first
            return Several(np.where(is_second, second, first))
        if name == "fabs":
            return abs(self)
        return _each(getattr(ops, name), *args)


def _values(number: Any) -> Any:
    """Return the values of several cases, or a float; other objects need single numbers."""
    if isinstance(number, Several):
        return number.values
    if isinstance(number, (float, int)):
        return float(number)
    _refused()


def _divided(numerator: Any, denominator: Any) -> Several:
    if not np.all(denominator):
        _refused()  # a float raises an error
    return Several(numerator / denominator)


def _each(function: Callable[..., float], *numbers: Any) -> Several:
    """Apply a function of floats to each case, because NumPy may round it differently."""
    columns = (each.tolist() for each in np.broadcast_arrays(*map(_values, numbers)))
    try:
        return Several(np.array(list(map(function, *columns)), dtype=float))
    except (ArithmeticError, ValueError) as error:
        raise DifferError(f"a case has no value ({error})") from None


def _forward(operation: Callable[..., Any], kind: type) -> Callable[..., Any]:
    return lambda first, second: kind(operation(first.values, _values(second)))


def _backward(operation: Callable[..., Any]) -> Callable[..., Several]:
    return lambda second, first: Several(operation(_values(first), second.values))


for _name in ("add", "sub", "mul"):
    _operation = getattr(operator, _name)
    setattr(Several, f"__{_name}__", _forward(_operation, Several))
    setattr(Several, f"__r{_name}__", _backward(_operation))
for _name in ("lt", "le", "gt", "ge", "eq", "ne"):
    setattr(Several, f"__{_name}__", _forward(getattr(operator, _name), Truths))
