"""Quantities at the edges: text with units to SI numbers and back. The only home of pint."""

from __future__ import annotations

import math
from functools import cache
from typing import TYPE_CHECKING, Any

from bywire.core.errors import UnitError
from bywire.core.quantities import display_unit

if TYPE_CHECKING:
    import pint


@cache
def registry() -> pint.UnitRegistry[Any]:
    """Return the one registry of units; loading pint takes a moment, so only on demand."""
    import pint

    known: pint.UnitRegistry[Any] = pint.UnitRegistry(cache_folder=":auto:")
    known.define("percent = 0.01 = %")
    return known


def parse(value: str | float, symbol: str, name: str) -> float:
    """Return a value in an SI unit.

    Parameters
    ----------
    value
        Text with a unit such as ``"9 mm"``, or a plain number, which is taken as SI.
    symbol
        SI unit wanted, ``"1"`` for a pure number.
    name
        What to call the value in an error.

    Raises
    ------
    UnitError
        When the text is no quantity, or its unit measures something else.

    Examples
    --------
    >>> parse("9 mm", "m", "pipeline.d_pl")
    0.009
    """
    if isinstance(value, bool):
        raise UnitError(f"{name} = {value}: a number is wanted{_in_unit(symbol)}")
    if isinstance(value, (int, float)):
        return float(value)
    import pint

    units = registry()
    try:
        quantity = units.Quantity(value.replace("%", " percent"))
        number = float(quantity.to("" if symbol == "1" else symbol).magnitude)
    except pint.DimensionalityError as error:
        raise UnitError(
            f"{name} = {value!r} has the wrong unit: {error.units1} cannot be {symbol}; "
            f"write for instance {example(symbol)!r}"
        ) from None
    except Exception:
        raise UnitError(
            f"{name} = {value!r} is not a quantity: write for instance {example(symbol)!r}"
        ) from None
    if not math.isfinite(number):
        raise UnitError(f"{name} = {value!r} is not finite{_in_unit(symbol)}")
    return float(f"{number:.15g}")  # 9 mm is 0.009 m, not 0.009000000000000001


def shown(value: float, symbol: str) -> str:
    """Return a value as the edges show it, for instance ``25 bar``."""
    unit = display_unit(symbol)
    number = convert(value, symbol, unit)
    return f"{number:.6g}" + ("" if unit == "1" else f" {unit}")


def convert(value: float, symbol: str, unit: str) -> float:
    """Return a value given in one unit in another of the same dimension."""
    if symbol == unit:
        return value
    factor: float = registry().Quantity(1.0, symbol).to(unit).magnitude
    return value * factor


def example(symbol: str) -> str:
    """Return a quantity that would be accepted."""
    unit = display_unit(symbol)
    return "1.5" if unit == "1" else f"1.5 {unit}"


def _in_unit(symbol: str) -> str:
    return "" if symbol == "1" else f" in {display_unit(symbol)}"
