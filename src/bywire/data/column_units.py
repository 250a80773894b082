"""Units as measurement files write them: titles such as ``p [bar]``, and conversion to SI."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from bywire.core.unit_list import Scale, meanings_of, scale_of

_PAIRS = {"]": "[", ")": "("}
_PURE = ("-", "--", "[-]")
"""what a column of pure numbers may have in the place of a unit"""


def split_title(title: str) -> tuple[str, str]:
    """Return name and unit of a column's title; the unit is empty where none is written.

    Examples
    --------
    >>> split_title("p_mc [bar]"), split_title("pedal"), split_title("p (bar(g))")
    (('p_mc', 'bar'), ('pedal', ''), ('p', 'bar(g)'))
    """
    end = title[-1:]
    depth = 0
    for place in range(len(title) - 1, -1, -1) if end in _PAIRS else ():
        depth += (title[place] == end) - (title[place] == _PAIRS[end])
        if not depth:
            return title[:place].rstrip(), title[place + 1 : -1].strip()
    return title, ""


@cache
def unit_of(text: str) -> Scale:
    """Return the unit that a text names: of the list, or a product of such units.

    Raises
    ------
    UnknownUnitError
        When it is no such unit, or one of two meanings; the message says why.
    """
    return scale_of("1" if text in _PURE else text)


def unit_of_symbol(symbol: str) -> Scale:
    """Return the unit of a symbol that is declared to be one; ``"1"`` is a pure number's."""
    return meanings_of(symbol)[0]


def si_symbol(unit: Scale) -> str:
    """Return the SI unit of a unit's quantity."""
    return unit.symbol


def measures(unit: Scale, symbol: str) -> bool:
    """Return whether a unit measures the quantity of an SI unit; radians count."""
    return unit.powers == unit_of_symbol(symbol).powers


def convert_in_place(values: NDArray[np.float64], unit: Scale, symbol: str) -> None:
    """Turn values into an SI unit where they lie, for arrays of which there is no room for two."""
    slope = unit.factor / unit_of_symbol(symbol).factor
    if slope != 1.0:
        values *= slope
    if unit.zero:
        values += unit.zero
