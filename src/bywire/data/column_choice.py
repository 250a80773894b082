"""Which columns of a file become which signals, with which units and instants."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bywire.core.errors import FileError, UnitError, quoted, unknown_name
from bywire.core.unit_list import Scale
from bywire.data.column_units import convert_in_place, measures, si_symbol, split_title, unit_of
from bywire.data.file_format import Column, Source
from bywire.data.mapping import Clock, MeasurementMapping, SignalMapping

_CLOCKS = ("time", "t")
_SHOWN = 12


@dataclass(frozen=True)
class Chosen:
    """A signal to read.

    Parameters
    ----------
    mapping
        What its column means.
    column
        Name of the column.
    clock
        Where its instants come from; a column with its unit, or a rate.
    unit
        Unit of the scaled numbers.
    symbol
        SI unit of the signal.
    label
        Description.
    meanings
        What its numbers stand for, where they are numbers of something.
    """

    mapping: SignalMapping
    column: str
    clock: Clock
    unit: str
    symbol: str
    label: str
    meanings: str = ""

    def to_si(self, values: NDArray[np.float64]) -> None:
        """Turn numbers of the file into the signal, where they lie."""
        factor = self.mapping.sign * (1.0 if self.mapping.scale is None else self.mapping.scale)
        if factor != 1.0:
            values *= factor
        convert_in_place(values, unit_of(self.unit), self.symbol)
        if self.mapping.offset:
            values += self.mapping.offset

    def attributes(self) -> dict[str, Any]:
        """Return what a dataset says of the signal."""
        attributes: dict[str, Any] = {
            "units": self.symbol, "long_name": self.label, "column": self.column,
        }  # fmt: skip
        if self.meanings:
            attributes["flag_meanings"] = self.meanings
        if self.mapping.delay:
            attributes["delay"] = self.mapping.delay
        if self.mapping.limits is not None:
            attributes["valid_min"], attributes["valid_max"] = self.mapping.limits
        return attributes


def choose(
    file: Path, source: Source, meaning: MeasurementMapping, signals: Sequence[str] | None
) -> list[Chosen]:
    """Return the signals to read.

    Raises
    ------
    UnknownNameError
        For a signal that the mapping or the file does not have.
    FileError
        For a column that is not there, or when the file does not say its instants.
    UnitError
        When a unit is missing, unknown or contradicts that of the file.
    """
    wanted = dict(meaning.signals) or every_signal(file, source, meaning)
    if signals is not None:
        for name in signals:
            if name not in wanted:
                raise unknown_name("signal", name, wanted)
        wanted = {name: wanted[name] for name in signals}
    if not wanted:
        raise FileError(f"{file} holds no signal: {_listing(source.columns)}")
    return [_chosen(file, source, meaning, signal) for signal in wanted.values()]


def every_signal(
    file: Path, source: Source, meaning: MeasurementMapping
) -> dict[str, SignalMapping]:
    """Return every column that is no clock under its own name."""
    clocks = {c.clock for c in source.columns.values()}
    if meaning.clock is not None and meaning.clock.column:
        clocks |= {meaning.clock.column}
    elif clocks == {None} or meaning.clock is not None:
        clocks |= {_usual_clock(source)}
    names = [name for name in source.columns if name not in clocks]
    return {name: SignalMapping(name, name) for name in names}


def _chosen(
    file: Path, source: Source, meaning: MeasurementMapping, signal: SignalMapping
) -> Chosen:
    column = _column(file, source, signal.column, f"signals.{signal.name}.column")
    clock = _clock(file, source, column, signal.clock or meaning.clock)
    unit = signal.unit or column.unit
    where = f"{file}, column {quoted(column.name)}"
    if not unit:
        raise UnitError(
            f"{where}: it has no unit: write it behind the title, as '{signal.name} [mm]', or in a "
            f"mapping, as [signals.{signal.name}] unit = 'bar', or '1' for none"
        )
    symbol = si_symbol(_known_unit(unit, where))
    if signal.unit and column.unit and signal.scale is None:
        _require_same(signal, column, where)
    label = signal.label or column.label or signal.name
    return Chosen(signal, column.name, clock, unit, symbol, label, column.meanings)


def _known_unit(unit: str, where: str) -> Scale:
    try:
        return unit_of(unit)
    except UnitError as error:
        raise UnitError(
            f"{where}: {error}: write the unit in a mapping, for instance unit = 'bar', or '1' for "
            "a pure number"
        ) from None


def _require_same(signal: SignalMapping, column: Column, where: str) -> None:
    """Refuse a mapping whose unit is another one than the file's."""
    unit = _known_unit(column.unit, where)
    said = unit_of(signal.unit)
    if (unit.factor, unit.zero, unit.powers) == (said.factor, said.zero, said.powers):
        return
    raise UnitError(
        f"{where}: the file says {column.unit!r} and the mapping {signal.unit!r}: leave "
        f"signals.{signal.name}.unit out, or give signals.{signal.name}.scale, which tells how "
        f"many {signal.unit} the number 1 is"
    )


def _clock(file: Path, source: Source, column: Column, given: Clock | None) -> Clock:
    if given is not None and given.rate:
        return given
    if given is not None:
        clock = _column(file, source, given.column, "time.column")
    else:
        name = column.clock or _usual_clock(source)
        if name is None:
            before = (
                "; where other lines stand before the table, a mapping's skip_lines tells how many"
            )
            raise FileError(
                f"{file} does not say when it was measured: call a column 'time [s]', or write in "
                "a mapping "
                'time = { column = "t", unit = "ms" } or rate = "1 kHz"; '
                + _listing(source.columns)
                + (before if len(source.columns) == 1 else "")
            )
        clock = source.columns[name]
    unit = (given.unit if given is not None else "") or clock.unit
    where = f"{file}, column {quoted(clock.name)}"
    if not unit:
        raise UnitError(
            f"{where}: the time has no unit: write in a mapping "
            f'time = {{ column = "{clock.name}", unit = "ms" }}'
        )
    if not measures(_known_unit(unit, where), "s"):
        raise UnitError(f"{where}: {unit!r} is no unit of time: choose another column")
    if given is not None and given.unit and clock.unit:
        _require_same(SignalMapping("time", clock.name, given.unit), clock, where)
    return Clock(clock.name, unit)


def _usual_clock(source: Source) -> str | None:
    """Return the column that is called time or t; T in kelvin is no time."""
    for usual in _CLOCKS:
        for name, column in source.columns.items():
            if name.casefold() == usual and (not column.unit or _is_time(column.unit)):
                return name
    return None


def _is_time(unit: str) -> bool:
    try:
        return measures(unit_of(unit), "s")
    except UnitError:
        return False


def _column(file: Path, source: Source, name: str, key: str) -> Column:
    """Return a column by its name, or by its title with the unit behind it."""
    column = source.columns.get(name) or source.columns.get(split_title(name)[0])
    if column is not None:
        return column
    many = [other for other in source.columns if other.rpartition("@")[0] == name]
    near = many or get_close_matches(name, source.columns, n=3, cutoff=0.5)
    hint = f"is it {' or '.join(map(repr, near))}? " if near else ""
    there = _listing(source.columns)
    raise FileError(f"{file} has no column {quoted(name)} ({key}): {hint}{there}")


def _listing(columns: Mapping[str, Column]) -> str:
    names = list(columns)
    more = f" and {len(names) - _SHOWN} more" if len(names) > _SHOWN else ""
    return f"its columns are {', '.join(names[:_SHOWN])}{more}" if names else "it has no columns"
