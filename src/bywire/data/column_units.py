"""Units as measurement files write them: titles such as ``p [bar]``, and conversion to SI."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from bywire.core.unit_list import Scale, meanings_of, scale_of

_PAIRS = {"]": "[", ")": "("}
_PURE = ("-", "--", "[-]")
"""texts that a column of pure numbers may have instead of a unit"""


def split_title(title: str) -> tuple[str, str]:
    """Return name and unit of a column's title; the unit may be empty.

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
    """Return the unit that a text describes: one from the list, or a product of such units.

    Raises
    ------
    UnknownUnitError
        When it is not such a unit, or has two meanings; the message gives the reason.
    """
    return scale_of("1" if text in _PURE else text)


def unit_of_symbol(symbol: str) -> Scale:
    """Return the unit of a declared symbol; ``"1"`` is for a pure number."""
    return meanings_of(symbol)[0]


def si_symbol(unit: Scale) -> str:
    """Return the SI unit of a unit's quantity."""
    return unit.symbol


def measures(unit: Scale, symbol: str) -> bool:
    """Return whether a unit has the dimension of an SI unit; radians count."""
    return unit.powers == unit_of_symbol(symbol).powers


def convert_in_place(values: NDArray[np.float64], unit: Scale, symbol: str) -> None:
    """Convert values to an SI unit in place, since a second array may not fit into memory."""
    slope = unit.factor / unit_of_symbol(symbol).factor
    if slope != 1.0:
        values *= slope
    if unit.zero:
        values += unit.zero
