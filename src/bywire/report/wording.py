"""Texts for users: units, amounts and untrusted text, for figures, tables and pages alike."""

from __future__ import annotations

import math
from typing import TypeVar

from bywire.core.clean_text import clean as clean
from bywire.core.parameters import Leaf
from bywire.core.quantities import display_unit
from bywire.core.units import convert, difference_unit
from bywire.core.units import unit_text as unit_text

F = TypeVar("F")


def in_display_unit(value: F, symbol: str) -> tuple[F, str]:
    """Return a value, or an array, and its unit in display units: bar instead of Pa."""
    unit = display_unit(symbol)
    return convert(value, symbol, unit), unit


def readable_unit(size: float, symbol: str) -> str:
    """Return the most readable unit for a figure of a given size.

    Times below 1 s are in ms; lengths from 1 m on, those of roads and not of pistons, are in m.

    Parameters
    ----------
    size
        Largest magnitude to write, in ``symbol``.
    symbol
        SI unit, or ``"%"``.

    Examples
    --------
    >>> readable_unit(0.06, "s"), readable_unit(41.0, "m"), readable_unit(0.002, "m")
    ('ms', 'm', 'mm')
    """
    if symbol == "s" and abs(size) < 1.0:
        return "ms"
    if symbol == "m" and abs(size) >= 1.0:
        return "m"
    return display_unit(symbol)


def readable_units(symbol: str) -> str:
    """Return all units in which figures of an SI unit are written, for any size.

    Examples
    --------
    >>> readable_units("m"), readable_units("Pa")
    ('mm or m', 'bar')
    """
    return " or ".join(dict.fromkeys(readable_unit(size, symbol) for size in (0.0, math.inf)))


def amount(value: float | None, symbol: str, digits: int = 4, like: float | None = None) -> str:
    """Return a value with its unit in ``digits`` significant digits.

    Parameters
    ----------
    value
        Number in ``symbol``; ``None`` where there is none, NaN where it is not defined.
    symbol
        Unit; SI units are shown in their display unit.
    digits
        Significant digits.
    like
        Largest magnitude of the figure with this value, in ``symbol``. It determines the unit, so
        that a figure of many cases has one unit, see `readable_unit`. By default the value itself
        counts, and times are in s.

    Examples
    --------
    >>> amount(2.5e6, "Pa"), amount(None, "Pa"), amount(0.034, "1"), amount(1187.0, "Hz", 3)
    ('25 bar', '-', '0.034', '1190 Hz')
    >>> amount(0.0125, "m"), amount(41.07, "m")
    ('12.5 mm', '41.07 m')
    >>> amount(0.962, "s"), amount(0.962, "s", like=0.962), amount(0.9, "m", like=1.1)
    ('0.962 s', '962 ms', '0.9 m')
    """
    if value is None:
        return "-"
    if math.isnan(value):
        return "not defined"
    if like is None and symbol == "s":
        number, unit = float(value), "s"
    else:
        number, unit = _readable(float(value), value if like is None else like, symbol)
    written = unit_text(unit)
    figures = f"{number:.{digits}g}"
    if "e+" in figures:  # 1.19e+03
        figures = f"{float(figures):g}"
    return figures + (f" {written}" if written else "")


def measured_amount(value: float | None, symbol: str, error: float, digits: int = 4) -> str:
    """Return a value with the significant digits of its error and its unit; times below 1 s in ms.

    The last digit written has the place of the error's first one.

    Parameters
    ----------
    value
        Number in ``symbol``; ``None`` where there is none, NaN where it is not defined.
    symbol
        Unit; SI units are shown in their display unit.
    error
        Numerical error, in ``symbol``; NaN if it is not known.
    digits
        Most significant digits.

    Examples
    --------
    >>> measured_amount(0.062195, "s", 3e-4), measured_amount(2.5012e6, "Pa", 4e3)
    ('62.2 ms', '25.01 bar')
    >>> measured_amount(5.0823, "percent", 0.2), measured_amount(3.1416, "1", 0.0)
    ('5.1 %', '3.142')
    >>> measured_amount(0.0, "bar", 1e-10), measured_amount(0.004, "1", 0.02)
    ('0 bar', '0.00')
    """
    if value is None or not (math.isfinite(value) and math.isfinite(error)):
        return amount(value, symbol, digits)
    number, unit = _readable(value, value, symbol)
    possible = _readable_difference(error, value, symbol)[0]
    last = math.floor(math.log10(possible)) if possible > 0 else -400  # no float has that place
    first = math.floor(math.log10(abs(number))) if number else last
    if last <= first - digits + 1 or last == -400:
        figures = f"{number:.{digits}g}"
        figures = f"{float(figures):g}" if "e+" in figures else figures
    else:
        rounded = round(number, -last)
        is_nothing = rounded == 0 and -last >= digits  # many zeros show no more than one digit
        figures = "0" if is_nothing else f"{rounded:.{max(0, -last)}f}"
    written = unit_text(unit)
    return figures + (f" {written}" if written else "")


def error_text(value: float | None, symbol: str, error: float, converges: bool = True) -> str:
    """Return an error with one digit, in the unit of the value in `measured_amount`.

    ``converges``: whether it is an error, rather than a bound of an unknown one.

    Examples
    --------
    >>> error_text(0.062195, "s", 2.6e-4), error_text(3.2, "1", 0.0)
    ('0.3 ms', '0')
    """
    if value is None or math.isnan(value) or math.isnan(error):
        return "-"
    if math.isinf(error):
        return "unknown"
    number, unit = _readable_difference(error, value, symbol)
    written = unit_text(unit)
    text = f"{float(f'{number:.1g}'):g}" + (f" {written}" if written and number else "")
    return text if converges or not number else f"up to {text}"


def _readable_difference(number: float, value: float, symbol: str) -> tuple[float, str]:
    """Return a difference in the most readable unit of a value; for temperatures in K."""
    return _readable(number, value, difference_unit(symbol))


def _readable(number: float, value: float, symbol: str) -> tuple[float, str]:
    """Return a number in the most readable unit of a value."""
    unit = readable_unit(value, symbol)
    return convert(float(number), symbol, unit), unit


def range_text(leaf: Leaf) -> str:
    """Return the valid range of a parameter in its display unit, for instance ``> 0 mm``."""
    if leaf.low == leaf.high:
        return f"exactly {amount(leaf.low, leaf.unit.symbol, 6)}"
    limits = []
    for sign, bound, is_open in (
        (">", leaf.low, leaf.low_open),
        ("<", leaf.high, leaf.high_open),
    ):
        if math.isfinite(bound):
            limits.append(f"{sign if is_open else sign + '='} {amount(bound, leaf.unit.symbol, 6)}")
    return " and ".join(limits) or "any finite number"


def duration(seconds: float) -> str:
    """Return a time span in ms or s, whichever is easier to read."""
    return f"{1e3 * seconds:.3g} ms" if abs(seconds) < 1.0 else f"{seconds:.4g} s"
