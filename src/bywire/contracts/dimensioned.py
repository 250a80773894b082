"""Numbers that carry their unit through the equations and refuse sums of unlike quantities."""

from __future__ import annotations

import math
import operator
from collections.abc import Callable
from typing import Any, Self

from bywire.core import ops
from bywire.core.units import registry

PURE = ("exp", "log", "sin", "cos", "arctan", "floor", "power")  # functions of pure numbers only


class Dimensioned:
    """A number with a unit; zero goes with every unit, any other plain number is pure.

    A plain NaN is what is not known: it goes with every unit too, and so does what follows from it.
    """

    __array_ufunc__ = None  # NumPy's scalars hand operations over to this class

    def __init__(self, value: float, unit: str = "1") -> None:
        self.quantity = registry().Quantity(value, "" if unit == "1" else unit).to_base_units()

    @classmethod
    def of(cls, quantity: Any) -> Self:
        """Wrap a quantity of pint."""
        self = cls.__new__(cls)
        self.quantity = quantity
        return self

    def __repr__(self) -> str:
        return f"{self.quantity:~}"

    def __add__(self, other: Any) -> Any:
        return _combined(operator.add, self, other)

    def __radd__(self, other: Any) -> Any:
        return _combined(operator.add, other, self)

    def __sub__(self, other: Any) -> Any:
        return _combined(operator.sub, self, other)

    def __rsub__(self, other: Any) -> Any:
        return _combined(operator.sub, other, self)

    def __mul__(self, other: Any) -> Any:
        return _combined(operator.mul, self, other)

    def __rmul__(self, other: Any) -> Any:
        return _combined(operator.mul, other, self)

    def __truediv__(self, other: Any) -> Any:
        return _combined(operator.truediv, self, other)

    def __rtruediv__(self, other: Any) -> Any:
        return _combined(operator.truediv, other, self)

    def __pow__(self, exponent: float) -> Dimensioned:
        return Dimensioned.of(self.quantity**exponent)

    def __neg__(self) -> Dimensioned:
        return Dimensioned.of(-self.quantity)

    def __abs__(self) -> Dimensioned:
        return Dimensioned.of(abs(self.quantity))

    def __lt__(self, other: Any) -> Condition:
        return Condition(operator.lt, self, other)

    def __le__(self, other: Any) -> Condition:
        return Condition(operator.le, self, other)

    def __gt__(self, other: Any) -> Condition:
        return Condition(operator.gt, self, other)

    def __ge__(self, other: Any) -> Condition:
        return Condition(operator.ge, self, other)

    def __eq__(self, other: object) -> Condition:  # type: ignore[override]
        return Condition(operator.eq, self, other)

    def has_unit(self, unit: str) -> bool:
        """Tell whether the dimension is that of a unit."""
        return bool(self.quantity.is_compatible_with("" if unit == "1" else unit))

    def _bywire_op(self, name: str, *args: Any) -> Any:
        if name in PURE:
            return Dimensioned(getattr(ops, name)(*(float(_quantity(a).to("")) for a in args)))
        if name == "sqrt":
            return self**0.5
        if name == "fabs":
            return abs(self)
        if name in ("fmax", "fmin"):
            x, y = _alike(*args)
            return Dimensioned.of(max(x, y) if name == "fmax" else min(x, y))
        raise TypeError(f"ops.{name} says no dimension: give it one in Dimensioned._bywire_op")


class Condition:
    """Outcome of a comparison: chooses in ``ops.where``, refuses to steer an ``if``."""

    def __init__(self, compare: Callable[[Any, Any], bool], left: Any, right: Any) -> None:
        self.holds = bool(compare(*_alike(left, right)))

    def __bool__(self) -> bool:
        raise TypeError("the flow of an equation must not hang on a value: use ops.where")

    def _bywire_op(self, name: str, *args: Any) -> Any:
        condition, then, otherwise = args  # of ops.where, the only one that takes a condition
        x, y = _alike(then, otherwise)
        return Dimensioned.of(x if condition.holds else y)


def fits(value: Any, unit: str) -> bool:
    """Tell whether a result has the dimension of a unit; a plain zero has that of any."""
    if isinstance(value, Dimensioned):
        return value.has_unit(unit)
    plain = _is_nothing(value) or _is_unknown(value)
    return plain or Dimensioned(value).has_unit(unit)


def _quantity(value: Any) -> Any:
    return value.quantity if isinstance(value, Dimensioned) else registry().Quantity(value)


def _combined(operation: Callable[[Any, Any], Any], left: Any, right: Any) -> Any:
    if operation in (operator.add, operator.sub):
        return Dimensioned.of(operation(*_alike(left, right)))
    if _is_unknown(left) or _is_unknown(right):
        return float("nan")
    if _is_nothing(left) or (operation is operator.mul and _is_nothing(right)):
        return 0.0  # nothing goes with every unit, times anything too
    return Dimensioned.of(operation(_quantity(left), _quantity(right)))


def _is_nothing(value: Any) -> bool:
    return not isinstance(value, Dimensioned) and value == 0


def _is_unknown(value: Any) -> bool:
    return not isinstance(value, Dimensioned) and math.isnan(value)


def _alike(left: Any, right: Any) -> tuple[Any, Any]:
    """Return two quantities of one dimension; zero and unknown ones take that of the other."""
    x, y = _quantity(left), _quantity(right)
    if _is_nothing(left) or _is_unknown(left):
        x = float(left) * y
    elif _is_nothing(right) or _is_unknown(right):
        y = float(right) * x
    return x, y.to(x.units)
