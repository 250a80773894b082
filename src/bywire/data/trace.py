"""Read a measured trace, for instance of a rider's pedal, from a text table (CSV, TSV).

The first row names every column with its unit in brackets, ``time [s], pedal [mm]``; then one
row per instant. Tab, semicolon or comma separates the columns; a decimal comma is understood
between tabs and semicolons. The file is not trusted: a cell is a number and nothing else, and
what is doubtful is refused, never guessed.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from bywire.core import units
from bywire.core.errors import FileError, ParameterError, UnitError
from bywire.core.quantities import display_unit
from bywire.data.text_table import Table, numbers, read_table

if TYPE_CHECKING:
    import pint

_GAP = 10.0  # median steps: a pause must be longer to count as a gap
_CLOCKS = ("time", "t")
_TITLE = re.compile(r"(?P<name>.*?)\s*[\[(](?P<unit>[^\[\]()]*)[\])]")
_POWER = r"[A-Za-zµμΩ°%_]+(?:(?:\*\*|\^)-?[0-9])?"
_UNIT = re.compile(rf"(?:1|(?:1/)?{_POWER}(?:[*/· ]{_POWER})*)")
_SI = (
    "1", "s", "m", "rad", "m/s", "rad/s", "N", "Pa", "N*m", "A", "V", "W", "ohm", "Hz",
    "m/s**2", "m**2", "m**3", "m**3/s", "kg", "K",
)  # fmt: skip


@dataclass(frozen=True)
class _Column:
    index: int
    name: str
    unit: str | None


def read_trace(
    path: str | Path,
    columns: Mapping[str, str] | None = None,
    *,
    max_gap: str | float = 0.1,
) -> xr.Dataset:
    """Return the columns of a text table as signals over time, SI inside.

    Parameters
    ----------
    path
        A text file in UTF-8.
    columns
        Needed columns and the SI unit of each, for instance ``{"pedal": "m"}``; others are
        left alone. Without it every column is read, each in the SI unit of its quantity.
    max_gap
        Longest pause between two rows, text with a unit or [s]. A longer one is refused when
        it is longer than ten median steps too.

    Returns
    -------
    xarray.Dataset
        Dimension ``time`` [s]; variables of shape ``(time,)`` with ``units`` and ``long_name``;
        attribute ``source`` with the file's name.

    Raises
    ------
    FileError
        When the file cannot be read or understood: with file, line, column, value, next step.
    UnitError
        When a unit is missing, unknown, or measures something else.
    ParameterError
        When ``max_gap`` is not a positive duration.
    """
    longest = units.parse(max_gap, "s", "max_gap")
    if not longest > 0:
        raise ParameterError(f"max_gap = {max_gap!r} is not admissible: it must be > 0 s")
    table = read_table(Path(path))
    known = _columns(table)
    clock = next((known[name] for name in _CLOCKS if name in known), None)
    if clock is None:
        raise _missing(table, "time", "s", known)
    wanted = _wanted(table, known, clock, columns)
    symbols = ["s", *wanted.values()]
    chosen = [clock, *wanted]
    scales = [_unit(table, c, symbol) for c, symbol in zip(chosen, symbols, strict=True)]
    values = numbers(table, [c.index for c in chosen], [c.name for c in chosen])
    if len(values) < 2:
        raise FileError(f"{table.path} has {len(values)} rows of numbers: two at least are needed")
    si = [_converted(v, u, s) for v, u, s in zip(values.T, scales, symbols, strict=True)]
    _require_increasing(table, clock, si[0])
    _require_no_gap(table, clock, si[0], longest)
    given = {name.strip().casefold(): name for name in columns or ()}
    signals = {
        given.get(c.name.casefold(), c.name): (
            "time", v, {"units": s, "long_name": c.name},
        )
        for c, v, s in zip(chosen[1:], si[1:], symbols[1:], strict=True)
    }  # fmt: skip
    time = ("time", si[0], {"units": "s", "long_name": "time"})
    return xr.Dataset(signals, coords={"time": time}, attrs={"source": table.path.name})


def _columns(table: Table) -> dict[str, _Column]:
    """Return the named columns of the header by their names in lower case."""
    found: dict[str, _Column] = {}
    for index, title in enumerate(table.header):
        match = _TITLE.fullmatch(title)
        name = match["name"] if match else title
        if not name:
            continue
        if name.casefold() in found:
            raise FileError(f"{_header(table, name)}: the name stands twice: rename one of them")
        found[name.casefold()] = _Column(index, name, match["unit"].strip() if match else None)
    return found


def _wanted(
    table: Table,
    known: Mapping[str, _Column],
    clock: _Column,
    columns: Mapping[str, str] | None,
) -> dict[_Column, str]:
    """Return the columns to read beside time, and the SI unit of each."""
    if columns is None:
        found = {c: _si(table, c) for c in known.values() if c != clock}
        if not found:
            raise FileError(
                f"{table.path}, line {table.header_line}: {' '.join(table.header)!r} names no "
                "column beside time: add one, or separate the columns by comma, semicolon or tab"
            )
        return found
    wanted: dict[_Column, str] = {}
    for name, symbol in columns.items():
        found_column = known.get(name.strip().casefold())
        if found_column is None:
            raise _missing(table, name, symbol, known)
        wanted[found_column] = symbol
    return wanted


def _missing(table: Table, name: str, symbol: str, known: Mapping[str, _Column]) -> FileError:
    names = [c.name for c in known.values()]
    near = get_close_matches(name.casefold(), known, n=1, cutoff=0.5)
    hint = f"is it {known[near[0]].name!r}? Then rename that" if near else "add it"
    return FileError(
        f"{table.path}, line {table.header_line}: no column {name!r} among {', '.join(names)!r}: "
        f"{hint} to '{name} [{display_unit(symbol)}]'"
    )


def _unit(table: Table, column: _Column, symbol: str | None) -> pint.Unit:
    """Return the unit of a column; with a symbol it must measure the same quantity."""
    where = _header(table, column.name)
    example = f"'{column.name} [{display_unit(symbol or '1')}]'"
    if not column.unit:
        raise UnitError(f"{where}: it has no unit: write for instance {example}")
    text = re.sub(r"(?<=N)(?=m\b)", "*", "1" if column.unit == "-" else column.unit)
    try:
        if not _UNIT.fullmatch(text):
            raise ValueError(text)
        spelled = text.replace("%", "percent").replace("·", "*").replace(" ", "*")
        unit: pint.Unit = units.registry().Unit("" if text == "1" else spelled)
    except Exception:
        raise UnitError(
            f"{where}: {column.unit!r} is no known unit: write for instance {example}"
        ) from None
    if symbol is not None and _base(unit) != _base(_pint(symbol)):
        raise UnitError(
            f"{where}: {column.unit!r} has the wrong unit, it cannot be {symbol}: "
            f"write for instance {example}"
        )
    return unit


def _si(table: Table, column: _Column) -> str:
    """Return the SI unit of a column's quantity."""
    base = _base(_unit(table, column, None))
    return next((s for s in _SI if _base(_pint(s)) == base), f"{base:~C}")


def _pint(symbol: str) -> pint.Unit:
    unit: pint.Unit = units.registry().Unit("" if symbol == "1" else symbol)
    return unit


def _base(unit: pint.Unit) -> Any:
    """Return the base units; radians stay, so that rpm is no frequency in Hz."""
    return units.registry().Quantity(1.0, unit).to_base_units().units


def _converted(values: NDArray[np.float64], unit: pint.Unit, symbol: str) -> NDArray[np.float64]:
    return np.asarray(units.registry().Quantity(values, unit).to(_pint(symbol)).magnitude)


def _require_increasing(table: Table, clock: _Column, t: NDArray[np.float64]) -> None:
    bad = np.flatnonzero(np.diff(t) <= 0)
    if bad.size:
        k = int(bad[0]) + 1
        now, before = table.rows[k][clock.index], table.rows[k - 1][clock.index]
        what = "is repeated" if t[k] == t[k - 1] else f"follows {before}"
        raise FileError(
            f"{table.where(k, clock.name)}: {now} {clock.unit} {what} (line {table.lines[k - 1]}): "
            "time must increase: sort the rows and remove repeated ones"
        )


def _require_no_gap(table: Table, clock: _Column, t: NDArray[np.float64], longest: float) -> None:
    steps = np.diff(t)
    gaps = np.flatnonzero((steps > _GAP * np.median(steps)) & (steps > longest))
    if gaps.size:
        k = int(gaps[0])
        most = float(np.max(steps[gaps]))
        raise FileError(
            f"{table.where(k + 1, clock.name)}: a gap of {steps[k]:.4g} s after "
            f"{table.rows[k][clock.index]} {clock.unit} ({gaps.size} in the file, the longest "
            f"{most:.4g} s; max_gap is {longest:g} s): fill it in, or, if a straight line across "
            f'it is what you want, allow it with max_gap="{1.01 * most:.3g} s"'
        )


def _header(table: Table, name: str) -> str:
    return f"{table.path}, line {table.header_line}, column {name!r}"
