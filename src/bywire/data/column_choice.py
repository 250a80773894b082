"""Assignment of a file's columns to signals, with units and times."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from difflib import get_close_matches
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bywire.core.errors import FileError, UnitError, counted, quoted, unknown_name
from bywire.core.unit_list import Scale
from bywire.data.column_units import convert_in_place, measures, si_symbol, split_title, unit_of
from bywire.data.file_format import Column, Source
from bywire.data.mapping import Clock, MeasurementMapping, SignalMapping

_CLOCKS = ("time", "t", "zeit", "timestamp", "time stamp", "date time", "datetime", "x_value")
_SHOWN = 12
_NO_VALUE = (9.9e37, -9.9e37, 9.91e37)
"""numbers of SCPI instruments for missing values: infinity and not-a-number"""


class MissingUnitsError(UnitError):
    """All requested columns that have no unit.

    Parameters
    ----------
    text
        Problem and next step.
    lacking
        Problem alone.
    signals
        Name of the signal -> its column.
    clock
        Time column, if it has no unit either.
    """

    def __init__(
        self,
        text: str,
        lacking: str = "",
        signals: Mapping[str, str] | None = None,
        clock: str = "",
    ) -> None:
        self.lacking, self.signals, self.clock = lacking, dict(signals or {}), clock
        super().__init__(text)


class NoClockError(FileError):
    """A file without a time column.

    Parameters
    ----------
    text
        Next step.
    signals
        Name of the signal -> its column, for requested signals without a unit.
    """

    def __init__(self, text: str, signals: Mapping[str, str] | None = None) -> None:
        self.text, self.signals = text, dict(signals or {})
        super().__init__(text)


def _missing_units(file: Path, signals: Mapping[str, str], clock: str = "") -> MissingUnitsError:
    columns = [*map(quoted, signals.values()), *([quoted(clock)] if clock else [])]
    only = "column" if signals else "time column"
    lacking = (
        f"{file}: the columns {', '.join(columns)} have no unit"
        if len(columns) > 1
        else f"{file}: the {only} {columns[0]} has no unit"
    )
    title, inside = f"{clock} [ms]", f'time = {{ column = "{clock}", unit = "ms" }}'
    for name, column in signals.items():
        title, inside = f"{column} [mm]", f"[signals.{name}] unit = 'mm'"
    text = (
        f"{lacking}. Write the unit after the title, for example '{title}', or in a mapping, for "
        f"example {inside}. The unit of a pure number is '1'"
    )
    return MissingUnitsError(text, lacking, signals, clock)


@dataclass(frozen=True)
class Chosen:
    """A signal to read.

    Parameters
    ----------
    mapping
        Mapping of its column.
    column
        Name of the column.
    clock
        Source of its times: a column with its unit, or a rate.
    unit
        Unit of the scaled numbers.
    symbol
        SI unit of the signal.
    label
        Description.
    meanings
        Texts for its numbers, if the numbers are codes.
    missing
        Numbers in the file that mark missing values.
    """

    mapping: SignalMapping
    column: str
    clock: Clock
    unit: str
    symbol: str
    label: str
    meanings: str = ""
    missing: tuple[float, ...] = ()

    def to_si(self, values: NDArray[np.float64]) -> list[str]:
        """Convert the file's numbers to the signal in place, and return notes."""
        notes = self._without_marks(values)
        factor = self.mapping.sign * (1.0 if self.mapping.scale is None else self.mapping.scale)
        if factor != 1.0:
            values *= factor
        convert_in_place(values, unit_of(self.unit), self.symbol)
        if self.mapping.offset:
            values += self.mapping.offset
        if unit_of(self.unit).reference == "absolute":
            notes.append(
                f"{self.mapping.name} is an absolute pressure ({self.unit!r}), but brake pressures "
                "are relative to ambient. Use offset = '-1.013 bar' in the mapping to subtract a "
                "typical ambient pressure"
            )
        return notes

    def _without_marks(self, values: NDArray[np.float64]) -> list[str]:
        """Replace numbers that mark missing values by NaN, and return a note."""
        found, total = [], 0
        for mark in dict.fromkeys((*_NO_VALUE, *self.missing)):
            is_mark = (values == mark) | (values == np.float32(mark))
            if count := int(np.count_nonzero(is_mark)):
                values[is_mark] = np.nan
                total += count
                found.append(f"{count} x {mark:g}")
        is_infinite = np.isinf(values)
        if count := int(np.count_nonzero(is_infinite)):
            values[is_infinite] = np.nan
            total += count
            found.append(f"{count} x infinite")
        name = self.mapping.name
        return [f"{name}: missing samples: {total} ({', '.join(found)})"] if found else []

    def attributes(self) -> dict[str, Any]:
        """Return the signal's attributes in a dataset."""
        attributes: dict[str, Any] = {
            "units": self.symbol,
            "long_name": self.label,
            "column": self.column,
        }
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
        For a missing column, or a file without times.
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
        skipped = _sentences(source.left_out)
        raise FileError(
            f"{file} contains no signal. {_listing(source.columns)}{skipped}",
            name=str(file),
        )
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
        raise _missing_units(file, lacking, clock)
    return chosen


def _title_unit(source: Source, column: str) -> str:
    """Return the unit in brackets after a column's name, unless they are part of the name."""
    columns = source.columns
    is_name = column in columns or any(column == each.path for each in columns.values())
    return "" if is_name else split_title(column)[1]


def every_signal(
    file: Path, source: Source, meaning: MeasurementMapping
) -> dict[str, SignalMapping]:
    """Return all columns that are not clocks, under their own names."""
    clocks = {c.clock for c in source.columns.values()}
    if meaning.clock is not None and meaning.clock.column:
        clocks |= {_column(file, source, meaning.clock.column, "time.column").name}
    elif clocks == {None} or meaning.clock is not None:
        clocks |= {usual_clock(source)}
    names = [name for name in source.columns if name not in clocks]
    return {name: SignalMapping(name, name) for name in names}


def _chosen(
    file: Path, source: Source, meaning: MeasurementMapping, signal: SignalMapping
) -> Chosen:
    column = _column(file, source, signal.column, f"signals.{signal.name}.column", signal.number)
    unit = signal.unit or column.unit
    lacking = {} if unit else {signal.name: column.name}
    try:
        clock = _clock(file, source, column, signal.clock or meaning.clock)
    except MissingUnitsError as error:
        raise _missing_units(file, lacking, error.clock) from None
    except NoClockError as error:
        raise NoClockError(error.text, lacking) from None
    where = f"{file}, column {quoted(column.name)}"
    if lacking:
        raise _missing_units(file, lacking)
    symbol = si_symbol(_known_unit(unit, where))
    if signal.unit and column.unit and signal.scale is None:
        _require_same(signal, column, where)
    label = signal.label or column.label or signal.name
    missing = tuple(_as_numbers((*meaning.missing, *signal.missing)))
    return Chosen(signal, column.name, clock, unit, symbol, label, column.meanings, missing)


def _as_numbers(marks: Sequence[float | str]) -> Iterator[float]:
    """Yield the marks of missing values that are numbers, including numbers written as texts."""
    for mark in marks:
        try:
            yield float(mark)
        except ValueError:
            continue


def _known_unit(unit: str, where: str) -> Scale:
    try:
        return unit_of(unit)
    except UnitError as error:
        raise UnitError(
            f"{where}: {error}. Specify the unit in a mapping, for example unit = 'bar', or '1' "
            "for a pure number",
            name="unit",
            value=unit,
        ) from None


def _require_same(signal: SignalMapping, column: Column, where: str, is_time: bool = False) -> None:
    """Reject a mapping whose unit differs from the file's."""
    unit = _known_unit(column.unit, where)
    mapped = unit_of(signal.unit)
    if (unit.factor, unit.zero, unit.powers) == (mapped.factor, mapped.zero, mapped.powers):
        return
    scale = f"set signals.{signal.name}.scale in the mapping to the value that a 1 in the file has"
    wrong = "correct it" if is_time else f"{scale} in {signal.unit}"
    raise UnitError(
        f"{where}: the unit is {column.unit!r} in the file but {signal.unit!r} in the brackets or "
        f"the mapping. Remove {signal.unit!r}, because bywire converts {column.unit!r}. If the "
        f"file's unit is wrong, {wrong}",
        name=signal.name,
        value=str(signal.unit),
        valid=column.unit,
    )


def _clock(file: Path, source: Source, column: Column, given: Clock | None) -> Clock:
    if given is not None and given.rate:
        return given
    if given is not None:
        given = replace(given, unit=given.unit or _title_unit(source, given.column))
        clock = _column(file, source, given.column, "time.column", given.number)
    else:
        name = column.clock or usual_clock(source)
        if name is None:
            before = (
                ". If other lines precede the table, set skip_lines in a mapping to their number"
            )
            skipped = _sentences(source.left_out)
            raise NoClockError(
                f"{file} has no time column. Rename a column 'time [s]', or add "
                'time = { column = "t", unit = "ms" } or rate = "1 kHz" to a mapping. '
                + _listing(source.columns)
                + (before if len(source.columns) == 1 or source.remarks else "")
                + skipped,
                {},
            )
        clock = source.columns[name]
    unit = (given.unit if given is not None else "") or clock.unit
    where = f"{file}, column {quoted(clock.name)}"
    if not unit:
        raise _missing_units(file, {}, clock.name)
    if not measures(_known_unit(unit, where), "s"):
        raise UnitError(
            f"{where}: {unit!r} is not a unit of time. Choose another column",
            name=clock.name,
            value=unit,
        )
    if given is not None and given.unit and clock.unit:
        _require_same(SignalMapping("time", clock.name, given.unit), clock, where, is_time=True)
    return Clock(clock.name, unit)


def usual_clock(source: Source) -> str | None:
    """Return the column with a usual name of a time, such as t; T in kelvin is not a time."""
    columns = source.columns
    for usual in _CLOCKS:
        for name, column in columns.items():
            if name.casefold() == usual and (not column.unit or _is_time(column.unit)):
                return name
    return None


def _is_time(unit: str) -> bool:
    try:
        return measures(unit_of(unit), "s")
    except UnitError:
        return False


def _column(file: Path, source: Source, name: str, key: str, number: int = 0) -> Column:
    """Return a column by name, by title with unit, or by number."""
    columns, order = source.columns, source.order
    title = split_title(name)[0]
    if not number and title.isdecimal() and not {name, title} & {*columns, *source.left_out}:
        number = int(title[:9])
    if number:
        if number > len(order):
            raise FileError(
                f"{file} has no column {number} ({key}). It has only "
                f"{counted(len(order), 'column')}",
                name=key,
                value=str(number),
                valid=str(len(order)),
            )
        name = order[number - 1]
    title = split_title(name)[0]
    column = columns.get(name) or columns.get(title)
    column = column or next((c for c in columns.values() if c.path == name), None)
    if column is not None:
        return column
    reason = source.left_out.get(name) or source.left_out.get(title)
    if reason is not None:
        raise FileError(
            f"{file}: bywire does not read the column {quoted(name)} ({key}) because {reason}",
            name=key,
            value=name,
        )
    many = [other for other in columns if other.rpartition("@")[0] == name]
    near = many or get_close_matches(name, columns, n=3, cutoff=0.5)
    hint = f"Did you mean {' or '.join(map(repr, near))}? " if near else ""
    raise FileError(
        f"{file} has no column {quoted(name)} ({key}). {hint}{_listing(columns)}",
        name=key,
        value=name,
        valid=", ".join(near),
    )


def left_out_note(left_out: Mapping[str, str]) -> list[str]:
    """Return one note for each reason to skip content of a file."""
    by_reason: dict[str, list[str]] = {}
    for name, reason in left_out.items():
        by_reason.setdefault(reason, []).append(quoted(name))
    return [
        f"not read: {', '.join(names[:_SHOWN])}"
        + (f" and {len(names) - _SHOWN} more" if len(names) > _SHOWN else "")
        + f". Reason: {reason}"
        for reason, names in by_reason.items()
    ]


def _sentences(left_out: Mapping[str, str]) -> str:
    """Return the notes of `left_out_note` as sentences after another one."""
    return "".join(f". {note[0].upper()}{note[1:]}" for note in left_out_note(left_out))


def _listing(columns: Mapping[str, Column]) -> str:
    names = list(columns)
    more = f" and {len(names) - _SHOWN} more" if len(names) > _SHOWN else ""
    return f"Its columns are {', '.join(names[:_SHOWN])}{more}" if names else "It has no columns"
