"""Dimensions that replace numbers in equations, and reject sums of different quantities.

Dimensions have no value, so no operating point can hide a mistake. They need no unit library.
"""

from __future__ import annotations

import math
from functools import cache
from typing import Any

from bywire.core.errors import UnitError
from bywire.core.units import base_powers

BASE = ("kg", "m", "s", "A", "K", "mol", "cd")
_NAMED = (
    "1",
    "rad",
    "Hz",
    "N",
    "Pa",
    "J",
    "N*m",
    "W",
    "C",
    "V",
    "ohm",
    "H",
    "F",
    "delta_degC",
    "T",
    "Wb",
    "N*m/A",
)
"""units whose names represent their dimensions"""
_PURE = frozenset({"exp", "log", "sin", "cos", "arctan", "floor"})


class DimensionError(UnitError):
    """Quantities that cannot be added or compared, or a function that needs a pure number."""


class Dimension:
    """A quantity with a dimension and no value.

    A plain zero has any dimension, even as a factor. A plain NaN has an unknown dimension.

    Parameters
    ----------
    powers
        Exponents of kg, m, s, A, K, mol and cd. An angle is a pure number.
    """

    __slots__ = ("powers",)
    __array_ufunc__ = None  # NumPy scalars delegate operations to this class

    def __init__(self, powers: tuple[float, ...]) -> None:
        self.powers = powers

    @classmethod
    def of(cls, unit: str) -> Dimension:
        """Return a unit's dimension, for example of ``"N*m"``.

        Raises
        ------
        UnitError
            When the unit is unknown.
        """
        return _parsed(unit)

    def __str__(self) -> str:
        return _names().get(self.powers) or "*".join(
            name if power == 1 else f"{name}**{power:g}"
            for name, power in zip(BASE, self.powers, strict=True)
            if power
        )

    def __repr__(self) -> str:
        return f"Dimension({self})"

    def __add__(self, other: Any) -> Any:
        return _alike("added", self, other)

    __radd__ = __add__

    def __sub__(self, other: Any) -> Any:
        return _alike("subtracted", self, other)

    __rsub__ = __sub__

    def __mul__(self, other: Any) -> Any:
        return _product(self, other, 1)

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Any:
        return _product(self, other, -1)

    def __rtruediv__(self, other: Any) -> Any:
        return _product(other, self, -1)

    def __pow__(self, exponent: float) -> Dimension:
        return Dimension(tuple(round(power * exponent, 9) for power in self.powers))

    def __neg__(self) -> Dimension:
        return self

    def __abs__(self) -> Dimension:
        return self

    def __lt__(self, other: Any) -> Condition:
        return Condition(self, other)

    __le__ = __gt__ = __ge__ = __lt__

    def __eq__(self, other: object) -> Any:
        return Condition(self, other)

    __hash__ = None  # type: ignore[assignment]

    def fits(self, unit: str) -> bool:
        """Return whether this is the dimension of a unit."""
        return self.powers == Dimension.of(unit).powers

    def _bywire_op(self, name: str, *args: Any) -> Any:
        if name in _PURE or name == "power":
            for value in args:
                if not _unknown(value) and any(_dimension(value).powers):
                    raise DimensionError(
                        f"ops.{name} needs a pure number, but got a quantity in {value}",
                        name=f"ops.{name}",
                        value=str(value),
                        valid="a pure number",
                    )
            return Dimension.of("1")
        if name == "sqrt":
            return self**0.5
        if name == "fabs":
            return self
        if name in ("fmax", "fmin"):
            return _alike("compared", *args)
        raise DimensionError(f"ops.{name} has no dimension", name=f"ops.{name}")


class Condition:
    """Outcome of a comparison: ``ops.where`` accepts it, but an ``if`` does not."""

    def __init__(self, left: Any, right: Any) -> None:
        _alike("compared", left, right)

    def __bool__(self) -> bool:
        raise DimensionError(
            "if does not work with the model's numbers. Use core.ops.where", valid="core.ops.where"
        )

    def _bywire_op(self, name: str, *args: Any) -> Any:
        _, then, otherwise = args  # from ops.where, the only function of a condition
        return _alike("chosen between", then, otherwise)

    def __and__(self, other: Any) -> Condition:
        return self

    __or__ = __rand__ = __ror__ = __and__


def fits(value: Any, unit: str) -> bool:
    """Return whether a result has the dimension of a unit; a plain zero has any dimension."""
    if isinstance(value, Dimension):
        return value.fits(unit)
    return bool(value == 0) or _unknown(value) or Dimension.of("1").fits(unit)


def _dimension(value: Any) -> Dimension:
    return value if isinstance(value, Dimension) else Dimension.of("1")


def _alike(verb: str, left: Any, right: Any) -> Any:
    """Return the common dimension of two quantities; zero and NaN adopt the other's dimension."""
    for zero, other in ((left, right), (right, left)):
        if not isinstance(zero, Dimension) and (zero == 0 or _unknown(zero)):
            return other
    x, y = _dimension(left), _dimension(right)
    if x.powers != y.powers:
        text = f"a quantity in {x} and one in {y} cannot be {verb}"
        raise DimensionError(text, value=str(x), valid=str(y))
    return x


def _product(left: Any, right: Any, sign: int) -> Any:
    if _unknown(left) or _unknown(right):
        return math.nan
    if not isinstance(left, Dimension) and left == 0:
        return left
    if not isinstance(right, Dimension) and right == 0 and sign > 0:
        return right
    pairs = zip(_dimension(left).powers, _dimension(right).powers, strict=True)
    return Dimension(tuple(a + sign * b for a, b in pairs))


def _unknown(value: Any) -> bool:
    return isinstance(value, float) and math.isnan(value)


@cache
def _parsed(unit: str) -> Dimension:
    return Dimension(base_powers(unit or "1", BASE))


@cache
def _names() -> dict[tuple[float, ...], str]:
    """Return the usual name of each named dimension; N*m for energy and torque."""
    names = sorted((*_NAMED, *BASE), key=lambda name: (name == "J", name == "rad", name))
    return {_parsed(name).powers: name for name in reversed(names)}
