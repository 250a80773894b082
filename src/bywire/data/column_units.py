"""Units as measurement files write them: titles such as ``p [bar]``, and conversion to SI."""

from __future__ import annotations

import re
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bywire.core import units

_POWER = r"[A-Za-zµμΩ°%_]+(?:(?:\*\*|\^)-?[0-9])?"
_UNIT = re.compile(rf"(?:1|(?:1/)?{_POWER}(?:[*/· ]{_POWER})*)")
_LONGEST = 60  # characters: no unit is longer, and the pattern stays quick on hostile text
_SI = (
    "1", "s", "m", "rad", "m/s", "rad/s", "N", "Pa", "N*m", "A", "V", "W", "ohm", "Hz",
    "m/s**2", "m**2", "m**3", "m**3/s", "kg", "K",
)  # fmt: skip
_WHOLE = {**{symbol: symbol for symbol in _SI}, "J": "N*m"}
"""units that are SI as they stand, and what `si_symbol` calls them"""


class Whole(str):
    """A unit that is SI as it stands: most files hold no other, and pint takes long to load."""

    __slots__ = ()


def split_title(title: str) -> tuple[str, str]:
    """Return name and unit of a column's title; the unit is empty where none is written.

    Examples
    --------
    >>> split_title("p_mc [bar]"), split_title("pedal")
    (('p_mc', 'bar'), ('pedal', ''))
    """
    cut = max(title.rfind("["), title.rfind("("))
    if cut >= 0 and title[-1] in "])":
        return title[:cut].rstrip(), title[cut + 1 : -1].strip()
    return title, ""


@cache
def unit_of(text: str) -> Any:
    """Return the unit that a text names: a product of names, nothing that is computed.

    Raises
    ------
    ValueError
        When it is no known unit.
    """
    plain = re.sub(r"(?<=N)(?=m\b)", "*", "1" if text == "-" else text)
    if len(text) > _LONGEST or not _UNIT.fullmatch(plain):
        raise ValueError(text)
    if plain in _WHOLE:
        return Whole(plain)
    try:
        unit = unit_of_symbol(plain.replace("%", "percent").replace("·", "*").replace(" ", "*"))
        base_of(unit)
    except Exception:  # pint has many ways to refuse a name
        raise ValueError(text) from None
    return unit


def unit_of_symbol(symbol: str) -> Any:
    """Return the unit of a symbol that is known to be one; ``"1"`` is a pure number's."""
    return Whole(symbol) if symbol in _WHOLE else _of_pint(symbol)


def _of_pint(unit: Any) -> Any:
    """Return a unit as pint has it, also of its symbol."""
    if not isinstance(unit, str):
        return unit
    return units.registry().Unit("" if unit == "1" else str(unit))


def base_of(unit: Any) -> Any:
    """Return the base units; radians stay, so that rpm is no frequency in Hz."""
    return units.registry().Quantity(1.0, _of_pint(unit)).to_base_units().units


@cache
def si_symbol(unit: Any) -> str:
    """Return the SI unit of a unit's quantity."""
    if isinstance(unit, Whole):
        return _WHOLE[unit]
    base = base_of(unit)
    return next((s for s in _SI if base_of(unit_of_symbol(s)) == base), f"{base:~C}")


def measures(unit: Any, symbol: str) -> bool:
    """Return whether a unit measures the quantity of an SI unit."""
    if isinstance(unit, Whole) and symbol in _WHOLE:
        return _WHOLE[unit] == _WHOLE[symbol]
    return bool(base_of(unit) == base_of(unit_of_symbol(symbol)))


def converted(values: NDArray[np.float64], unit: Any, symbol: str) -> NDArray[np.float64]:
    """Return values in an SI unit."""
    if isinstance(unit, Whole) and symbol in _WHOLE and measures(unit, symbol):
        return np.array(values, dtype=np.float64)
    quantity = units.registry().Quantity(values, _of_pint(unit))
    return np.asarray(quantity.to(_of_pint(unit_of_symbol(symbol))).magnitude)


def convert_in_place(values: NDArray[np.float64], unit: Any, symbol: str) -> None:
    """Turn values into an SI unit where they lie, for arrays of which there is no room for two."""
    zero, unity = converted(np.array([0.0, 1.0]), unit, symbol)
    slope = float(f"{unity - zero:.15g}")  # 0.001 for mm, and not its neighbor
    if slope != 1.0:
        values *= slope
    if zero:
        values += zero
