"""Quantities at the edges: text with units to SI numbers and back. The only home of pint."""

from __future__ import annotations

import math
import re
from functools import cache
from typing import TYPE_CHECKING, Any, Self, TypeVar

from bywire.core.clean_text import clean
from bywire.core.errors import ParameterError, UnitError, quoted
from bywire.core.quantities import display_unit

if TYPE_CHECKING:
    import pint

F = TypeVar("F")


# The common units, and all that the edges show: most commands then need no pint, whose loading
# takes half as long as a run.
_COMMON: dict[str, tuple[float, str]] = {
    "bar": (1e5, "Pa"),
    "Pa": (1.0, "Pa"),
    "mm": (1e-3, "m"),
    "um": (1e-6, "m"),
    "m": (1.0, "m"),
    "s": (1.0, "s"),
    "ms": (1e-3, "s"),
    "us": (1e-6, "s"),
    "A": (1.0, "A"),
    "mA": (1e-3, "A"),
    "V": (1.0, "V"),
    "W": (1.0, "W"),
    "J": (1.0, "J"),
    "N": (1.0, "N"),
    "Hz": (1.0, "Hz"),
    "ohm": (1.0, "ohm"),
    "rad": (1.0, "rad"),
    "deg": (math.pi / 180.0, "rad"),
    "mm/rad": (1e-3, "m/rad"),
    "mm**2": (1e-6, "m**2"),
    "ml": (1e-6, "m**3"),
    "bar/A": (1e5, "Pa/A"),
    "A*bar": (1e5, "A*Pa"),
    "N/bar": (1e-5, "N/Pa"),
    "K": (1.0, "delta_degC"),
    "%": (1e-2, "1"),
    "": (1.0, "1"),
}
# Further ones that texts are written in; they are read by pint, whose last digits stay.
_WRITTEN: dict[str, tuple[float, str]] = {"km/h": (1.0 / 3.6, "m/s"), "kN": (1e3, "N")}
_NUMBER = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d{1,3})?)\s*(.*?)\s*", re.DOTALL)
# Names, products, quotients and small powers; nothing that would make pint compute. A separator
# between two names is required: without one, a long word could be split in a billion ways.
_POWER = r"[A-Za-zµμΩ%°]+(?:(?:\*\*|\^)-?\d|[²³])?"
_FACTOR = rf"(?:{_POWER}|\({_POWER}(?: *[*·] *{_POWER})*\))"
_UNIT = re.compile(rf"(?:1? */ *)?{_FACTOR}(?:(?: *[*/·] *| +){_FACTOR})*")
_MOMENT = re.compile(r"(?<=N)m(s?)(?![A-Za-z])")  # Nm, kNm, Nms: pint knows N*m alone
_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_SIGNS = {"ohm": "Ω", "percent": "%", "degree": "°", "deg": "°", "degC": "°C"}
_LONGEST = 100  # characters: no quantity is longer, and patterns stay quick on hostile text
_WORDS = {"1": "a pure number", "delta_degC": "a temperature difference in K"}
ICE = 273.15
"""0 degC [K]"""
# pint takes rad as a pure number: it would turn 60 rpm into 6.28 Hz, 1 into 57 degrees, and 2 mm
# into 2 mm/rad where 2 mm/rev may be meant.
_NO_MATTER_OF_RAD = ("Hz", "rad/s", "rad", "1", "m/rad")


class Written(float):
    """A number in SI that remembers how it was written, for errors to repeat.

    Parameters
    ----------
    value
        The number, SI.
    text
        What it was read from, for instance ``"-0.02mm"``.
    """

    text: str

    def __new__(cls, value: float, text: str = "") -> Self:
        """Return the number with its text."""
        written = super().__new__(cls, value)
        written.text = text
        return written

    def __getnewargs__(self) -> tuple[float, str]:  # type: ignore[override]
        """Return what a copy is made of."""
        return float(self), self.text


@cache
def registry() -> pint.UnitRegistry[Any]:
    """Return the one registry of units; loading pint takes a moment, so only on demand."""
    import pint

    # No cache folder: pint's is a pickle that an interrupted or parallel process leaves damaged.
    known: pint.UnitRegistry[Any] = pint.UnitRegistry()
    known.define("percent = 0.01 = %")
    known.define("@alias turn = rev")
    return known


def parse(value: str | float, symbol: str, name: str, nominal: float = 1.0) -> float:
    """Return a value in an SI unit.

    Parameters
    ----------
    value
        Text with a unit such as ``"9 mm"``, or a plain number, which is taken as SI.
    symbol
        SI unit wanted, ``"1"`` for a pure number.
    name
        What to call the value in an error.
    nominal
        Its usual magnitude in that unit, for the example that an error gives.

    Raises
    ------
    UnitError
        When the text is no quantity, or its unit measures something else. Texts are not
        evaluated: a number and a product of unit names, nothing more.
    ParameterError
        When the number is not finite.

    Examples
    --------
    >>> parse("9 mm", "m", "pipeline.d_pl")
    0.009
    """
    if isinstance(value, bool) or not isinstance(value, (str, int, float)):
        raise UnitError(
            f"{name} = {quoted(value)}: one number is wanted, for instance "
            f"{example(symbol, nominal)!r}"
        )
    try:
        number = _number(value, symbol, name, nominal) if isinstance(value, str) else float(value)
    except OverflowError:  # a whole number of 309 digits or more
        number = math.inf
    if not math.isfinite(number):
        raise ParameterError(
            f"{name} = {quoted(value)} is not admissible: "
            f"it must be any finite number{_in_unit(symbol)}"
        )
    return number


def _number(text: str, symbol: str, name: str, nominal: float) -> float:
    match = _NUMBER.fullmatch(text) if len(text) <= _LONGEST else None
    if match is None or (match[2] and not _UNIT.fullmatch(match[2])):
        raise UnitError(
            f"{name} = {quoted(text)} is not a quantity: write for instance "
            f"{example(symbol, nominal)!r}"
        )
    size, unit = float(match[1]), match[2]
    common = _COMMON.get(unit)
    if common is not None and common[1] == symbol:
        return _converted(size, size * common[0])
    if (unit, symbol) == ("degC", "K"):
        return _converted(size, size + ICE)
    import pint

    try:
        quantity = registry().Quantity(size, _as_pint(unit))
        wanted = registry().Quantity(1.0, "" if symbol == "1" else symbol)
        if symbol in _NO_MATTER_OF_RAD and _base(quantity) != _base(wanted):
            raise pint.DimensionalityError(unit, symbol)
        return _converted(size, float(quantity.to(wanted.units).magnitude))
    except pint.DimensionalityError:
        raise UnitError(
            f"{name} = {text!r} has the wrong unit: {unit or 'a pure number'} cannot be "
            f"{_wanted(symbol)}; write for instance {example(symbol, nominal)!r}"
        ) from None
    except (pint.PintError, ValueError, TypeError, ArithmeticError, AttributeError):
        raise UnitError(
            f"{name} = {text!r}: the unit {unit!r} is not known; "
            f"write for instance {example(symbol, nominal)!r}"
        ) from None


def split(text: str) -> tuple[str, str]:
    """Return number and unit of a text that `parse` has read.

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
        When nobody knows the unit.

    Examples
    --------
    >>> base_powers("bar", ("kg", "m", "s"))
    (1.0, -1.0, -2.0)
    """
    import pint

    try:
        base = registry().Quantity(1.0, _as_pint(unit)).to_base_units()
        known = {name: registry().Quantity(1.0, name).dimensionality for name in bases}
    except (pint.PintError, ValueError, TypeError, ArithmeticError, AttributeError):
        raise UnitError(f"the unit {unit!r} is not known: write it as N*m/rad or m**3/s") from None
    powers = {str(dimension): float(str(p)) for dimension, p in base.dimensionality.items()}
    return tuple(powers.get(next(iter(known[name])), 0.0) for name in bases)


def has_own_zero(unit: str, symbol: str) -> bool:
    """Return whether zero of a unit is not zero in an SI unit: of degC and degF in K."""
    return parse(f"0 {unit}", symbol, unit) != 0.0


def _base(quantity: Any) -> Any:
    """Return the base units of a quantity, radians among them."""
    return quantity.to_base_units().units


def _as_pint(unit: str) -> str:
    """Return a unit as pint reads it."""
    spelled = unit.replace("%", "percent").replace("·", "*")
    spelled = f"1{spelled}" if spelled.startswith("/") else spelled
    return _MOMENT.sub(lambda m: "*m*s" if m[1] else "*m", spelled)


def _converted(size: float, number: float) -> float:
    """Return 0.009 for 9 mm, and not 0.009000000000000001; what is in SI already as it is."""
    return size if number == size else float(f"{number:.15g}")


def _wanted(symbol: str) -> str:
    return _WORDS.get(symbol, symbol)


def unit_text(symbol: str) -> str:
    """Return a unit as people write it; empty for a pure number.

    Examples
    --------
    >>> unit_text("N*m"), unit_text("m**3/s"), unit_text("1")
    ('N·m', 'm³/s', '')
    """
    if symbol == "1":
        return ""
    raised = re.sub(r"\*\*(-?\d+)", lambda m: m[1].translate(_SUPERSCRIPTS), clean(symbol))
    dotted = re.sub(r"\s*\*\s*", "·", raised)
    return re.sub(r"[A-Za-z]+", lambda m: _SIGNS.get(m[0], m[0]), dotted)


def shown(value: float, symbol: str, unit: str = "") -> str:
    """Return a value as the edges show it, for instance ``25 bar``, or in another unit.

    Examples
    --------
    >>> shown(25e5, "Pa"), shown(100.0 / 3.6, "m/s", "km/h")
    ('25 bar', '100 km/h')
    """
    unit = unit or display_unit(symbol)
    number = convert(value, symbol, unit)
    return f"{number:.6g}" + ("" if unit == "1" else f" {unit}")


def convert(value: F, symbol: str, unit: str) -> F:
    """Return a value, or an array, given in one unit in another of the same dimension."""
    if symbol == unit:
        return value
    if {symbol, unit} == {"K", "degC"}:
        return value - ICE if unit == "degC" else value + ICE  # type: ignore[operator,return-value]
    common = _COMMON.get(unit, _WRITTEN.get(unit))
    if common is not None and common[1] == symbol:
        return value / common[0]  # type: ignore[operator,return-value]
    factor: float = registry().Quantity(1.0, symbol).to(unit).magnitude
    return value * factor  # type: ignore[operator,return-value]


def difference_unit(symbol: str) -> str:
    """Return the SI unit of differences: of temperatures one whose zero is no temperature.

    Examples
    --------
    >>> shown(20.0, "K"), shown(20.0, difference_unit("K")), difference_unit("Pa")
    ('-253.15 degC', '20 K', 'Pa')
    """
    return "delta_degC" if symbol == "K" else symbol


def display_factor(symbol: str) -> float:
    """Return what a difference of one SI unit is in the unit in which the edges show it.

    Of values themselves it is the scale only where both have the same zero, see `convert`.

    Examples
    --------
    >>> display_factor("Pa"), display_factor("K")
    (1e-05, 1.0)
    """
    symbol = difference_unit(symbol)
    return convert(1.0, symbol, display_unit(symbol))


def example(symbol: str, nominal: float = 1.0) -> str:
    """Return a quantity that would be accepted: of its usual magnitude, where one is known.

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
