"""Read a measured trace, for instance of a rider's pedal, from a text table (CSV, TSV).

The first row names every column with its unit in brackets, ``time [s], pedal [mm]``; then one
row per instant. Tab, semicolon or comma separates the columns; a decimal comma is understood
between tabs and semicolons. The file is not trusted: a cell is a number and nothing else, and
what is doubtful is refused, never guessed.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from difflib import get_close_matches
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from bywire.core import units
from bywire.core.errors import FileError, ParameterError, UnitError, quoted
from bywire.core.quantities import display_unit
from bywire.data.column_units import converted, measures, si_symbol, split_title, unit_of
from bywire.data.text_table import Table, numbers, read_table

_GAP = 10.0  # median steps: a pause must be longer to count as a gap
_CLOCKS = ("time", "t")


@dataclass(frozen=True)
class _Column:
    """A column: place, header's name and unit, and the signal it becomes with its SI unit."""

    index: int
    label: str
    unit: str
    is_twice: bool
    name: str = ""
    symbol: str = ""


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
    chosen = _chosen(table, columns)
    scales = [_unit(table, c) for c in chosen]
    values = numbers(table, [c.index for c in chosen], [c.label for c in chosen])
    if len(values) < 2:
        raise FileError(
            f"{table.path} has too few rows of numbers, {len(values)}: add some, two at least"
        )
    si = [converted(v, u, c.symbol) for v, u, c in zip(values.T, scales, chosen, strict=True)]
    _require_increasing(table, chosen[0], si[0])
    _require_no_gap(table, chosen[0], si[0], longest)
    signals = {
        c.name: ("time", v, {"units": c.symbol, "long_name": c.label})
        for c, v in zip(chosen[1:], si[1:], strict=True)
    }
    time = ("time", si[0], {"units": "s", "long_name": "time"})
    return xr.Dataset(signals, coords={"time": time}, attrs={"source": table.path.name})


def column_names(path: str | Path) -> tuple[str, ...]:
    """Return the names of a trace's columns in lower case; its numbers are not looked at.

    Raises
    ------
    FileError
        When the file is no text table.
    """
    return tuple(_known(read_table(Path(path))))


def _known(table: Table) -> dict[str, _Column]:
    """Return the named columns of the header by their names in lower case."""
    found: dict[str, _Column] = {}
    for index, title in enumerate(table.header):
        label, unit = split_title(title)
        if not label:
            continue
        key = label.casefold()
        found[key] = _Column(index, label, unit, is_twice=key in found)
    return found


def _chosen(table: Table, columns: Mapping[str, str] | None) -> list[_Column]:
    """Return time, then the columns to read."""
    known = _known(table)
    clock = next((known[name] for name in _CLOCKS if name in known), None)
    if clock is None:
        raise _missing(table, "time", "s", known)
    chosen = [replace(clock, name="time", symbol="s")]
    if columns is None:
        others = [c for c in known.values() if c != clock]
        chosen += [replace(c, name=c.label, symbol=si_symbol(_unit(table, c))) for c in others]
    for name, symbol in (columns or {}).items():
        found = known.get(name.strip().casefold())
        if found is None:
            raise _missing(table, name, symbol, known)
        if found != clock:
            chosen.append(replace(found, name=name, symbol=symbol))
    if len(chosen) == 1:
        raise FileError(
            f"{table.path}, line {table.header_line}: there is no column beside time: add one, "
            "or separate the columns by comma, semicolon or tab"
        )
    return chosen


def _missing(table: Table, name: str, symbol: str, known: Mapping[str, _Column]) -> FileError:
    near = get_close_matches(name.casefold(), known, n=1, cutoff=0.5)
    wanted = f"'{name} [{display_unit(symbol)}]'"
    hint = f"is it {known[near[0]].label!r}? Then rename that {wanted}" if near else f"add {wanted}"
    there = quoted(", ".join(c.label for c in known.values()))
    return FileError(
        f"{table.path}, line {table.header_line}: no column {name!r} among {there}: {hint}"
    )


def _unit(table: Table, column: _Column) -> Any:
    """Return the unit of a column; where it has a symbol, both must measure the same quantity."""
    where = _header(table, column.label)
    example = f"'{column.label} [{display_unit(column.symbol) if column.symbol else 'mm'}]'"
    if column.is_twice:
        raise FileError(f"{where}: the name stands twice, capitals or not: rename one of them")
    if not column.unit:
        raise UnitError(f"{where}: it has no unit: write for instance {example}, or [1] for none")
    try:
        unit = unit_of(column.unit)
    except ValueError:
        raise UnitError(
            f"{where}: {quoted(column.unit)} is no known unit: write for instance {example}"
        ) from None
    if column.symbol and not measures(unit, column.symbol):
        raise UnitError(
            f"{where}: {column.unit!r} has the wrong unit, it cannot be {column.symbol}: "
            f"write for instance {example}"
        )
    return unit


def _require_increasing(table: Table, clock: _Column, t: NDArray[np.float64]) -> None:
    bad = np.flatnonzero(np.diff(t) <= 0)
    if bad.size:
        k = int(bad[0]) + 1
        now, before = (table.rows[r][clock.index] for r in (k, k - 1))
        what = "is repeated" if t[k] == t[k - 1] else f"comes after {before} {clock.unit}"
        raise FileError(
            f"{table.where(k, clock.label)}: {now} {clock.unit} {what} in line "
            f"{table.lines[k - 1]}: time must increase: sort the rows, remove repeated ones"
        )


def _require_no_gap(table: Table, clock: _Column, t: NDArray[np.float64], longest: float) -> None:
    steps = np.diff(t)
    gaps = np.flatnonzero((steps > _GAP * np.median(steps)) & (steps > longest))
    if gaps.size:
        k = int(gaps[0])
        most = float(np.max(steps[gaps]))
        raise FileError(
            f"{table.where(k + 1, clock.label)}: a gap of {steps[k]:.4g} s after "
            f"{table.rows[k][clock.index]} {clock.unit} ({gaps.size} in the file, the longest "
            f"{most:.4g} s; max_gap is {longest:g} s): fill it in, or, if a straight line across "
            f'it is what you want, allow it with max_gap="{1.01 * most:.3g} s"'
        )


def _header(table: Table, label: str) -> str:
    return f"{table.path}, line {table.header_line}, column {quoted(label)}"
