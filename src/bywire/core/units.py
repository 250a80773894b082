"""Conversion of strings with units to SI numbers and back."""

from __future__ import annotations

import math
import re
from typing import Any, Self, TypeVar, cast

from bywire.core.clean_text import clean
from bywire.core.errors import UnitError, not_valid, quoted
from bywire.core.quantities import display_unit, readable_unit
from bywire.core.unit_list import (
    BASES,
    Scale,
    UnknownUnitError,
    UnreadableUnitError,
    meanings_of,
)

F = TypeVar("F")


_NUMBER = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d{1,3})?)\s*(.*?)\s*", re.DOTALL)
_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_SIGNS = {"um": "µm", "ohm": "Ω", "percent": "%", "degree": "°", "deg": "°", "degC": "°C"}
_DIFFERENCES = {"K": "delta_degC", "%": "percentage points", "percent": "percentage points"}
_LONGEST = 100  # characters; keeps patterns fast for hostile text
_WORDS = {"1": "a pure number", "delta_degC": "a temperature difference in K"}
ICE = 273.15
"""0 degC [K]"""
# Elsewhere, a radian is treated as a pure number: N*m equals N*m/rad. If this rule applied here,
# 60 rpm would become 6.28 Hz, 1 would become 57 degrees, and 2 mm would become 2 mm/rad although
# the user may mean 2 mm/rev.
_NO_MATTER_OF_RAD = ("Hz", "rad/s", "rad", "1", "m/rad")


class Written(float):
    """Number in SI units that remembers its original text, which errors quote.

    Parameters
    ----------
    value
        The number, SI.
    text
        Original text, for example ``"-0.02mm"``.
    """

    text: str

    def __new__(cls, value: float, text: str = "") -> Self:
        """Return the number with its text."""
        written = super().__new__(cls, value)
        written.text = text
        return written

    def __getnewargs__(self) -> tuple[float, str]:  # type: ignore[override]
        """Return the arguments of a copy."""
        return float(self), self.text


def parse(value: str | float, symbol: str, name: str, nominal: float = 1.0) -> float:
    """Return a value in an SI unit.

    Parameters
    ----------
    value
        String with a unit such as ``"9 mm"``, or a plain number in SI units.
    symbol
        Requested SI unit, ``"1"`` for a pure number.
    name
        Name of the value in errors.
    nominal
        Usual magnitude in the SI unit, for the example in errors.

    Raises
    ------
    UnitError
        When the string is not a quantity, or its unit has another dimension. A string contains only
        a number and a product of unit names. bywire never evaluates it as code.
    ParameterError
        When the number is not finite.

    Examples
    --------
    >>> parse("9 mm", "m", "pipeline.d_pl")
    0.009
    """
    if isinstance(value, bool) or not isinstance(value, (str, int, float)):
        raise UnitError(
            f"{name} = {quoted(value)} must be one number, for example "
            f"{example(symbol, nominal)!r}",
            name=name,
            value=quoted(value),
            valid="one number",
        )
    try:
        number = _number(value, symbol, name, nominal) if isinstance(value, str) else float(value)
    except OverflowError:  # a whole number of 309 digits or more
        number = math.inf
    if not math.isfinite(number):
        raise not_valid(name, quoted(value), f"any finite number{_in_unit(symbol)}")
    return number


def _number(text: str, symbol: str, name: str, nominal: float) -> float:
    match = _NUMBER.fullmatch(text) if len(text) <= _LONGEST else None
    valid = repr(example(symbol, nominal))
    write, fields = f"For example, write {valid}", {"name": name, "value": quoted(text)}
    if match is None:
        raise UnitError(
            f"{name} = {quoted(text)} is not a quantity. {write}", **fields, valid=valid
        )
    size, unit = float(match[1]), match[2]
    try:
        meanings = meanings_of(unit or "1")
    except UnreadableUnitError:
        reason = f"{name} = {quoted(text)} is not a quantity. {write}"
        raise UnitError(reason, **fields, valid=valid) from None
    except UnknownUnitError as error:
        reason = f"{name} = {text!r}: {error}. {write}"
        raise UnitError(reason, **fields, valid=valid) from None
    scale = next((each for each in meanings if _measures(each, symbol)), None)
    if scale is None:
        raise UnitError(
            f"{name} = {text!r} has the wrong unit: {unit or 'a pure number'} cannot be "
            f"converted to {_words(symbol)}. {write}",
            **fields,
            valid=valid,
        )
    if scale.reference == "absolute":
        raise UnitError(
            f"{name} = {text!r}: bywire cannot determine whether {name} is absolute or relative to "
            f"ambient pressure. Convert it to the kind that the bench needs. {write}",
            **fields,
            valid=valid,
        )
    return _converted(size, _in_si(size, scale))


def _measures(scale: Scale, symbol: str) -> bool:
    """Return whether a unit fits a quantity whose SI unit is the symbol."""
    target = _of_symbol(symbol)
    if scale.zero and symbol != "K":  # 20 degC is not a temperature difference
        return False
    if symbol in _NO_MATTER_OF_RAD:
        return scale.powers == target.powers
    return scale.powers[:-1] == target.powers[:-1]


def _in_si(number: float, scale: Scale) -> float:
    ratio = scale.ratio
    if ratio.denominator == 1 and not scale.turns:
        return number * ratio.numerator + scale.zero
    return number * scale.factor + scale.zero


def split(text: str) -> tuple[str, str]:
    """Return number and unit of a string that `parse` accepts.

    Examples
    --------
    >>> split("95deg")
    ('95', 'deg')
    """
    match = _NUMBER.fullmatch(text)
    return (match[1], match[2]) if match else (text, "")


def base_powers(unit: str, bases: tuple[str, ...]) -> tuple[float, ...]:
    """Return the exponents of SI base units in a unit.

    Raises
    ------
    UnitError
        When the string is neither a listed unit nor a product of listed units.

    Examples
    --------
    >>> base_powers("bar", ("kg", "m", "s"))
    (1.0, -1.0, -2.0)
    """
    powers = dict(zip(BASES, _of_symbol(unit).powers, strict=True))
    return tuple(float(powers[name]) for name in bases)


def si_value(number: float, unit: str) -> float:
    """Convert a number from a declared unit to SI."""
    return _in_si(number, _of_symbol(unit))


def has_own_zero(unit: str, symbol: str) -> bool:
    """Return whether a unit's zero differs from the SI unit's zero, as for degC and K."""
    return parse(f"0 {unit}", symbol, unit) != 0.0


def _of_symbol(symbol: str) -> Scale:
    """Return the scale of an SI unit or a declared unit, where C means coulomb."""
    return meanings_of(symbol)[0]


def _converted(size: float, number: float) -> float:
    """Round a converted number: 9 mm is 0.009, not 0.009000000000000001. Keep SI values."""
    return size if number == size else float(f"{number:.15g}")


def _words(symbol: str) -> str:
    return _WORDS.get(symbol, symbol)


def unit_text(symbol: str) -> str:
    """Return a unit in common notation; empty for a pure number.

    Examples
    --------
    >>> unit_text("N*m"), unit_text("m**3/s"), unit_text("1"), unit_text("delta_degC")
    ('N·m', 'm³/s', '', 'K')
    """
    if symbol == "1":
        return ""
    raised = re.sub(r"\*\*(-?\d+)", lambda m: m[1].translate(_SUPERSCRIPTS), clean(symbol))
    raised = raised.replace("delta_degC", "K")  # a temperature difference
    dotted = re.sub(r"\s*\*\s*", "·", raised)
    return re.sub(r"[A-Za-z]+", lambda m: _SIGNS.get(m[0], m[0]), dotted)


def shown(value: float, symbol: str, unit: str = "", digits: int = 6) -> str:
    """Return a value in its most readable unit, for example ``25 bar``, or in another unit.

    ``digits``: significant digits.

    Examples
    --------
    >>> shown(25e5, "Pa"), shown(0.05, "s"), shown(100.0 / 3.6, "m/s", "km/h")
    ('25 bar', '50 ms', '100 km/h')
    """
    unit = unit or readable_unit(value, symbol)
    number = convert(value, symbol, unit)
    return f"{number:.{digits}g}" + ("" if unit == "1" else f" {unit}")


def written_unit(text: str, symbol: str) -> str:
    """Return the unit of a text if it fits a quantity in an SI unit, otherwise an empty string.

    Examples
    --------
    >>> written_unit("-0.02mm", "m"), written_unit("+50%", "m"), written_unit("3", "m")
    ('mm', '', '')
    """
    unit = split(text)[1]
    try:
        return unit and (convert(0.0, symbol, unit), unit)[1]
    except UnitError:
        return ""


def convert(value: F, symbol: str, unit: str) -> F:
    """Convert a value or an array from one unit to another of the same dimension."""
    if symbol == unit:
        return value
    before, after = _of_symbol(symbol), _of_symbol(unit)
    if before.powers[:-1] != after.powers[:-1]:
        raise UnitError(f"{symbol} cannot be converted to {unit}", value=symbol, valid=unit)
    ratio, turns = before.ratio / after.ratio, before.turns - after.turns
    number: Any = value
    if before.zero:
        number = number + before.zero / before.factor
    if turns:
        number = number * (float(ratio) * math.pow(math.pi, turns))
    elif ratio.numerator == 1:
        number = number / ratio.denominator
    else:
        number = number * float(ratio)
    if after.zero:
        number = number - after.zero / after.factor
    return cast(F, number)


def difference_unit(symbol: str) -> str:
    """Return the SI unit of differences; for temperatures, a unit without an offset.

    Differences of percentages are in percentage points.

    Examples
    --------
    >>> shown(20.0, "K"), shown(20.0, difference_unit("K")), difference_unit("Pa")
    ('-253.15 degC', '20 K', 'Pa')
    >>> shown(3.8, difference_unit("%"))
    '3.8 percentage points'
    """
    return _DIFFERENCES.get(symbol, symbol)


def display_factor(symbol: str) -> float:
    """Return the factor that converts a difference from the SI unit to the display unit.

    The factor is valid for values only if both units have the same zero; see `convert`.

    Examples
    --------
    >>> display_factor("Pa"), display_factor("K")
    (1e-05, 1.0)
    """
    symbol = difference_unit(symbol)
    return convert(1.0, symbol, display_unit(symbol))


def example(symbol: str, nominal: float = 1.0) -> str:
    """Return a valid example of a quantity, with its usual magnitude if one is declared.

    Examples
    --------
    >>> example("Pa"), example("Pa", 2e6)
    ('1.5 bar', '20 bar')
    """
    unit = display_unit(symbol)
    if nominal != 1.0:
        return shown(nominal, symbol)
    return "1.5" if unit == "1" else f"1.5 {unit}"


def _in_unit(symbol: str) -> str:
    return "" if symbol == "1" else f" in {display_unit(symbol)}"
