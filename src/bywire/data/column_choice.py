"""Which columns of a file become which signals, with which units and instants."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from difflib import get_close_matches
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bywire.core.errors import FileError, UnitError, quoted, unknown_name
from bywire.data.column_units import (
    convert_in_place,
    converted,
    measures,
    si_symbol,
    split_title,
    unit_of,
)
from bywire.data.file_format import Column, Source
from bywire.data.mapping import Clock, MeasurementMapping, SignalMapping

_CLOCKS = ("time", "t")
_SHOWN = 12


class MissingUnitsError(UnitError):
    """Columns that have no unit, all of those that are to be read.

    Parameters
    ----------
    file
        Where they stand.
    signals
        Name of the signal -> its column.
    clock
        Column of the instants, where it has none either.
    """

    def __init__(self, file: Path, signals: Mapping[str, str], clock: str = "") -> None:
        self.signals, self.clock = dict(signals), clock
        columns = [*map(quoted, self.signals.values()), *([quoted(clock)] if clock else [])]
        each = "it has" if self.signals else "the time has"
        self.lacking = (
            f"{file}, columns {', '.join(columns)}: they have no unit"
            if len(columns) > 1
            else f"{file}, column {columns[0]}: {each} no unit"
        )
        title, inside = f"{clock} [ms]", f'time = {{ column = "{clock}", unit = "ms" }}'
        for name, column in self.signals.items():
            title, inside = f"{column} [mm]", f"[signals.{name}] unit = 'mm'"
        super().__init__(
            f"{self.lacking}: write it behind the title, as '{title}', or in a mapping, as "
            f"{inside}, or '1' for none"
        )


class NoClockError(FileError):
    """A file that does not say when it was measured.

    Parameters
    ----------
    text
        What to do about it.
    signals
        Name of the signal -> its column, of those to be read that have no unit either.
    """

    def __init__(self, text: str, signals: Mapping[str, str]) -> None:
        self.text, self.signals = text, dict(signals)
        super().__init__(text)


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
    chosen: list[Chosen] = []
    lacking: dict[str, str] = {}
    clock, timeless = "", ""
    for signal in wanted.values():
        try:
            unit = signal.unit or _title_unit(source, signal.column)
            chosen.append(_chosen(file, source, meaning, replace(signal, unit=unit)))
        except MissingUnitsError as error:
            lacking |= error.signals
            clock = clock or error.clock
        except NoClockError as error:
            lacking |= error.signals
            timeless = error.text
    if timeless:
        raise NoClockError(timeless, lacking)
    if lacking or clock:
        raise MissingUnitsError(file, lacking, clock)
    return chosen


def _title_unit(source: Source, column: str) -> str:
    """Return the unit that stands in brackets behind the name of a column, if it is not its own."""
    return "" if column in source.columns else split_title(column)[1]


def every_signal(
    file: Path, source: Source, meaning: MeasurementMapping
) -> dict[str, SignalMapping]:
    """Return every column that is no clock under its own name."""
    clocks = {c.clock for c in source.columns.values()}
    if meaning.clock is not None and meaning.clock.column:
        clocks |= {_column(file, source, meaning.clock.column, "time.column").name}
    elif clocks == {None} or meaning.clock is not None:
        clocks |= {_usual_clock(source)}
    names = [name for name in source.columns if name not in clocks]
    return {name: SignalMapping(name, name) for name in names}


def _chosen(
    file: Path, source: Source, meaning: MeasurementMapping, signal: SignalMapping
) -> Chosen:
    column = _column(file, source, signal.column, f"signals.{signal.name}.column")
    unit = signal.unit or column.unit
    lacking = {} if unit else {signal.name: column.name}
    try:
        clock = _clock(file, source, column, signal.clock or meaning.clock)
    except MissingUnitsError as error:
        raise MissingUnitsError(file, lacking, error.clock) from None
    except NoClockError as error:
        raise NoClockError(error.text, lacking) from None
    where = f"{file}, column {quoted(column.name)}"
    if lacking:
        raise MissingUnitsError(file, lacking)
    known_unit = _known_unit(unit, where)
    if signal.unit and column.unit and signal.scale is None:
        _require_same(signal, column, where)
    # A unit that is SI already keeps its name, for instance Pa*s.
    plain = float(converted(np.array([1.0]), known_unit, si_symbol(known_unit))[0]) == 1.0
    keeps = plain and si_symbol(known_unit) != "1" and unit.isascii() and unit[0].isalpha()
    symbol = _plain(unit) if keeps else si_symbol(known_unit)
    label = signal.label or column.label or signal.name
    return Chosen(signal, column.name, clock, unit, symbol, label, column.meanings)


def _plain(unit: str) -> str:
    """Return the SI unit as the dataset writes it."""
    return {"Nm": "N*m"}.get(unit, unit)


def _known_unit(unit: str, where: str) -> Any:
    try:
        return unit_of(unit)
    except ValueError:
        raise UnitError(
            f"{where}: {quoted(unit)} is no known unit: write it in a mapping, for instance "
            "unit = 'bar', or '1' for none"
        ) from None


def _require_same(signal: SignalMapping, column: Column, where: str) -> None:
    """Refuse a mapping whose unit is another one than the file's."""
    unit = _known_unit(column.unit, where)
    said = unit_of(signal.unit)
    two = np.array([1.0, 2.0])
    if measures(unit, si_symbol(said)) and np.array_equal(
        converted(two, unit, si_symbol(said)), converted(two, said, si_symbol(said))
    ):
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
        given = replace(given, unit=given.unit or _title_unit(source, given.column))
        clock = _column(file, source, given.column, "time.column")
    else:
        name = column.clock or _usual_clock(source)
        if name is None:
            before = (
                "; where other lines stand before the table, a mapping's skip_lines tells how many"
            )
            raise NoClockError(
                f"{file} does not say when it was measured: call a column 'time [s]', or write in "
                "a mapping "
                'time = { column = "t", unit = "ms" } or rate = "1 kHz"; '
                + _listing(source.columns)
                + (before if len(source.columns) == 1 else ""),
                {},
            )
        clock = source.columns[name]
    unit = (given.unit if given is not None else "") or clock.unit
    where = f"{file}, column {quoted(clock.name)}"
    if not unit:
        raise MissingUnitsError(file, {}, clock.name)
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
    except ValueError:
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
