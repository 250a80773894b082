"""Numbers with units for the evaluation of equations; they reject sums of different dimensions."""

from __future__ import annotations

import math
import operator
from collections.abc import Callable
from typing import Any, Self

from bywire.core import ops
from bywire.core.dimensions import BASE, DimensionError
from bywire.core.units import base_powers, si_value

PURE = ("exp", "log", "sin", "cos", "arctan", "floor", "power")  # accept only pure numbers


class Dimensioned:
    """Number with a unit; a plain zero has any unit, and any other plain number is pure.

    A plain NaN is an unknown value. It has any unit, and results computed from it also have any
    unit.
    """

    __array_ufunc__ = None  # NumPy scalars delegate operations to this class

    def __init__(self, value: float, unit: str = "1") -> None:
        self.value, self.powers = si_value(value, unit), base_powers(unit, BASE)

    @classmethod
    def of(cls, value: float, powers: tuple[float, ...]) -> Self:
        """Return a number in SI units with the exponents of its base units."""
        self = cls.__new__(cls)
        self.value, self.powers = value, powers
        return self

    def __repr__(self) -> str:
        named = (
            f"{name}**{power:g}" for name, power in zip(BASE, self.powers, strict=True) if power
        )
        return " ".join((f"{self.value:g}", "*".join(named))).strip()

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
        return Dimensioned.of(self.value**exponent, tuple(exponent * p for p in self.powers))

    def __neg__(self) -> Dimensioned:
        return Dimensioned.of(-self.value, self.powers)

    def __abs__(self) -> Dimensioned:
        return Dimensioned.of(abs(self.value), self.powers)

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
        """Return whether a number has the dimension of a unit."""
        return self.powers == base_powers(unit, BASE)

    def _bywire_op(self, name: str, *args: Any) -> Any:
        if name in PURE:
            return Dimensioned(getattr(ops, name)(*map(_pure, args)))
        if name == "sqrt":
            return self**0.5
        if name == "fabs":
            return abs(self)
        if name in ("fmax", "fmin"):
            x, y, powers = _alike(*args)
            return Dimensioned.of(max(x, y) if name == "fmax" else min(x, y), powers)
        raise TypeError(
            f"ops.{name} has no rule for dimensions. Define the rule in Dimensioned._bywire_op"
        )


class Condition:
    """Result of a comparison: valid in ``ops.where``, rejected in an ``if``."""

    def __init__(self, compare: Callable[[Any, Any], bool], left: Any, right: Any) -> None:
        self.holds = bool(compare(*_alike(left, right)[:2]))

    def __bool__(self) -> bool:
        raise TypeError("an equation must not branch on a value. Use ops.where")

    def _bywire_op(self, name: str, *args: Any) -> Any:
        condition, then, otherwise = args  # only ops.where accepts a condition
        x, y, powers = _alike(then, otherwise)
        return Dimensioned.of(x if condition.holds else y, powers)


def fits(value: Any, unit: str) -> bool:
    """Return whether a result has the dimension of a unit; a plain zero has any dimension."""
    if isinstance(value, Dimensioned):
        return value.has_unit(unit)
    plain = _is_nothing(value) or _is_unknown(value)
    return plain or Dimensioned(value).has_unit(unit)


def _parts(value: Any) -> tuple[float, tuple[float, ...]]:
    if isinstance(value, Dimensioned):
        return value.value, value.powers
    return value, (0.0,) * len(BASE)


def _pure(value: Any) -> float:
    number, powers = _parts(value)
    if any(powers):
        raise DimensionError(
            f"{value!r} is not a pure number", value=repr(value), valid="a pure number"
        )
    return float(number)


def _combined(operation: Callable[[Any, Any], Any], left: Any, right: Any) -> Any:
    if operation in (operator.add, operator.sub):
        x, y, powers = _alike(left, right)
        return Dimensioned.of(operation(x, y), powers)
    if _is_unknown(left) or _is_unknown(right):
        return float("nan")
    if _is_nothing(left) or (operation is operator.mul and _is_nothing(right)):
        return 0.0  # zero has any unit, even as a factor
    (x, of_left), (y, of_right) = _parts(left), _parts(right)
    sign = 1.0 if operation is operator.mul else -1.0
    powers = tuple(a + sign * b for a, b in zip(of_left, of_right, strict=True))
    return Dimensioned.of(operation(x, y), powers)


def _is_nothing(value: Any) -> bool:
    return not isinstance(value, Dimensioned) and value == 0


def _is_unknown(value: Any) -> bool:
    return not isinstance(value, Dimensioned) and math.isnan(value)


def _alike(left: Any, right: Any) -> tuple[float, float, tuple[float, ...]]:
    """Return two numbers and their common dimension; zero and NaN adopt the other's dimension."""
    (x, powers), (y, others) = _parts(left), _parts(right)
    if _is_nothing(left) or _is_unknown(left):
        return x, y, others
    if powers != others and not (_is_nothing(right) or _is_unknown(right)):
        text = f"{left!r} and {right!r} have different dimensions"
        raise DimensionError(text, value=repr(left), valid=repr(right))
    return x, y, powers
