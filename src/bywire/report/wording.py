"""Texts for users: units, amounts and untrusted text, for figures, tables and pages alike."""

from __future__ import annotations

import math
from typing import TypeVar

from bywire.core.clean_text import clean as clean
from bywire.core.parameters import Leaf
from bywire.core.quantities import BY_SIZE, display_unit, readable_unit
from bywire.core.units import convert, difference_unit
from bywire.core.units import unit_text as unit_text

F = TypeVar("F")

_ROUNDING = 1e-9  # fraction of the maximum magnitude below which a number is a rounding error
_LEAST = 1e-3  # minimum error of zero that is written, in its unit


def in_display_unit(value: F, symbol: str) -> tuple[F, str]:
    """Return a value, or an array, and its unit in display units: bar instead of Pa."""
    unit = display_unit(symbol)
    return convert(value, symbol, unit), unit


def readable_units(*symbols: str) -> str:
    """Return all units in which figures of one or more SI units are written, for any size.

    Examples
    --------
    >>> readable_units("m"), readable_units("ohm"), readable_units("A", "Pa")
    ('um, mm or m', 'ohm', 'A, Pa or bar')
    """
    sizes = (BY_SIZE.get(symbol, ((0.0, display_unit(symbol)),)) for symbol in symbols)
    *first, last = dict.fromkeys(unit for each in sizes for _, unit in each)
    return f"{', '.join(first)} or {last}" if first else last


def amount(value: float | None, symbol: str, digits: int = 4, like: float | None = None) -> str:
    """Return a value with its unit in ``digits`` significant digits; a whole count has all digits.

    Parameters
    ----------
    value
        Number in ``symbol``; ``None`` where there is none, NaN where it is not defined.
    symbol
        Unit; SI units are shown in their most readable unit, see `readable_unit`.
    digits
        Significant digits.
    like
        Largest magnitude of the numbers beside this one, in ``symbol``. It determines the unit, so
        that a figure of many cases has one unit, and what is a rounding error beside it is 0. By
        default the value itself counts.

    Examples
    --------
    >>> amount(2.5e6, "Pa"), amount(None, "Pa"), amount(0.034, "1"), amount(1187.0, "Hz", 3)
    ('25 bar', '-', '0.034', '1190 Hz')
    >>> amount(0.0125, "m"), amount(41.07, "m"), amount(12654.0, "1"), amount(1e-14, "%", like=5.0)
    ('12.5 mm', '41.07 m', '12654', '0 %')
    >>> amount(0.962, "s"), amount(0.9, "m", like=1.1)
    ('962 ms', '0.9 m')
    """
    if value is None:
        return "-"
    if math.isnan(value):
        return "not defined"
    size = abs(value) if like is None else abs(like)
    number, unit = _readable(float(value), size, symbol)
    if like is not None and abs(value) < _ROUNDING * size < math.inf:
        number = 0.0
    return _with_unit(_figures(number, symbol, digits), unit)


def measured_amount(
    value: float | None, symbol: str, error: float, digits: int = 4, like: float | None = None
) -> str:
    """Return a value with the significant digits of its error, and its unit.

    The last digit written has the place of the error's first one. A value below its error is 0.

    Parameters
    ----------
    value
        Number in ``symbol``; ``None`` where there is none, NaN where it is not defined.
    symbol, like
        As in `amount`.
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
    ('0 bar', '0')
    """
    if value is None or not (math.isfinite(value) and math.isfinite(error)):
        return amount(value, symbol, digits, like)
    size = value if like is None else like
    number, unit = _readable(value, size, symbol)
    possible = _readable_difference(error, size, symbol)[0]
    if abs(number) < possible:
        return _with_unit("0", unit)
    last = math.floor(math.log10(possible)) if possible > 0.0 else _last_place(number, digits)
    if last <= _last_place(number, digits):
        return _with_unit(_figures(number, symbol, digits), unit)
    return _with_unit(f"{round(number, -last):.{max(0, -last)}f}", unit)


def error_text(
    value: float | None,
    symbol: str,
    error: float,
    converges: bool = True,
    like: float | None = None,
) -> str:
    """Return an error with one digit, in the unit of the value in `measured_amount`.

    An error below the value's last digit is ``"< "`` that digit, or a thousandth of the unit beside
    zero.

    ``converges``: whether it is an error, rather than a bound of an unknown one.

    Examples
    --------
    >>> error_text(0.062195, "s", 2.6e-4), error_text(3.2, "1", 0.0)
    ('0.3 ms', '0')
    >>> error_text(60.0, "m", 1e-7), error_text(5.08, "%", 0.03)
    ('< 0.01 m', '0.03 percentage points')
    """
    if value is None or math.isnan(value) or math.isnan(error):
        return "-"
    if math.isinf(error):
        return "unknown"
    size = value if like is None else like
    number, unit = _readable_difference(error, size, symbol)
    if not number:
        return "0"
    shown = _readable(value, size, symbol)[0]
    least = _LEAST if abs(shown) < number else 10.0 ** _last_place(shown, 4)
    if number < least:
        return f"< {_with_unit(f'{least:g}', unit)}"
    text = _with_unit(f"{float(f'{number:.1g}'):g}", unit)
    return text if converges else f"up to {text}"


def beside_limit(
    value: float | None, error: float, symbol: str, limit: str
) -> tuple[float | None, float, str]:
    """Return a value, its error and their unit: in percent where its limit is in percent.

    Examples
    --------
    >>> beside_limit(0.75, 0.01, "1", ">= 80 %")
    (75.0, 1.0, '%')
    """
    if symbol != "1" or not limit.endswith("%"):
        return value, error, symbol
    return None if value is None else 100.0 * value, 100.0 * error, "%"


def part_text(value: float, symbol: str, whole: float) -> str:
    """Return a part of a whole; a part that is negligible next to the whole is ``"< "`` a bound.

    Examples
    --------
    >>> part_text(3.21987, "J", 21.7), part_text(8e-6, "J", 21.7), part_text(-1e-13, "J", 21.7)
    ('3.22 J', '< 0.001 J', '0 J')
    """
    number, unit = _readable(value, whole, symbol)
    least = 10.0 ** _last_place(_readable(whole, whole, symbol)[0], 5)
    if abs(value) < _ROUNDING * abs(whole):
        return _with_unit("0", unit)
    if abs(number) < least:
        return f"{'<' if value > 0.0 else '> -'} {_with_unit(f'{least:g}', unit)}"
    return _with_unit(_figures(number, symbol, 4), unit)


def _last_place(number: float, digits: int) -> int:
    """Return the power of ten of the last significant digit of a number; far below all for 0."""
    return math.floor(math.log10(abs(number))) - digits + 1 if number else -400


def _figures(number: float, symbol: str, digits: int) -> str:
    """Return a number without its unit."""
    if symbol == "1" and number.is_integer() and abs(number) < 1e9:
        return f"{number:.0f}"
    figures = f"{number:.{digits}g}"
    return f"{float(figures):g}" if "e+" in figures else figures  # 1.19e+03


def _with_unit(figures: str, unit: str) -> str:
    written = unit_text(unit)
    return figures + (f" {written}" if written else "")


def _readable_difference(number: float, value: float, symbol: str) -> tuple[float, str]:
    """Return a difference in the most readable unit of a value; for temperatures in K."""
    unit = difference_unit(symbol)
    shown = readable_unit(value, symbol) if unit == symbol else display_unit(unit)
    return convert(float(number), unit, shown), shown


def _readable(number: float, value: float, symbol: str) -> tuple[float, str]:
    """Return a number in the most readable unit of a value."""
    unit = readable_unit(value, symbol)
    return convert(float(number), symbol, unit), unit


def range_text(leaf: Leaf, value: object = None) -> str:
    """Return the valid range of a parameter, for example ``> 0 mm``.

    Parameters
    ----------
    leaf
        The parameter.
    value
        Number or table of numbers beside the range, whose unit the range uses; by default each
        bound has its most readable unit.
    """
    symbol, unit = leaf.unit.symbol, unit_beside(value, leaf.unit.symbol)

    def bound_text(bound: float) -> str:
        if not unit:
            return amount(bound, symbol, 6)
        return _with_unit(_figures(convert(float(bound), symbol, unit), symbol, 6), unit)

    return leaf.bounds_text(bound_text) or "any finite number"


def unit_beside(value: object, symbol: str) -> str:
    """Return the unit in which a number, or the largest of a table, is written; else empty.

    Examples
    --------
    >>> unit_beside(1.2, "s"), unit_beside((0.02, 0.3), "m"), unit_beside(None, "s")
    ('s', 'mm', '')
    """
    values = value if isinstance(value, (tuple, list)) else (value,)
    sizes = [abs(v) for v in values if isinstance(v, (int, float)) and math.isfinite(v)]
    return readable_unit(max(sizes), symbol) if sizes else ""
