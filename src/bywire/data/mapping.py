"""Meaning of a measurement file's columns, and mapping files (TOML) that define it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field

from bywire.core import units
from bywire.core.errors import (
    InputError,
    ParameterError,
    UnitError,
    not_valid,
    quoted,
    unknown_of_few,
)
from bywire.core.quantities import Unit
from bywire.core.section import Hint, Section
from bywire.core.values import written
from bywire.data.column_units import si_symbol, unit_of
from bywire.data.text_encoding import ENCODINGS
from bywire.data.toml_file import read_toml


@dataclass(frozen=True)
class Clock:
    """Source of the signals' times: a column, or a sample rate.

    Parameters
    ----------
    column
        Time column; empty for a rate.
    unit
        Its unit; empty if the file contains it.
    rate
        Sample rate [Hz]; 0 for a column.
    start
        Time of the first sample [s], for a rate.
    number
        Number of the column, from 1; 0 if it is specified by name.
    """

    column: str = ""
    unit: str = ""
    rate: float = 0.0
    start: float = 0.0
    number: int = 0


@dataclass(frozen=True)
class SignalMapping:
    """Meaning of a column: value = sign * scale * number [unit] + offset.

    Parameters
    ----------
    name
        Name of the signal.
    column
        Column of the file.
    unit
        Unit of the scaled number; empty if the file contains it.
    scale, sign
        Factors of the number in the file; ``scale`` is None if the file's unit applies.
    offset
        Added to the value, in SI.
    delay
        Delay of the column behind the quantity [s]; its samples are moved back by this time.
    limits
        Range in SI at whose ends the sensor clips; None if unknown.
    label
        Description, for figures.
    clock
        Source of its times; None for that of the whole file.
    number
        Number of the column, from 1; 0 if it is specified by name.
    missing
        Numbers and texts in the file that mark missing values.
    """

    name: str
    column: str
    unit: str = ""
    scale: float | None = None
    sign: int = 1
    offset: float = 0.0
    delay: float = 0.0
    limits: tuple[float, float] | None = None
    label: str = ""
    clock: Clock | None = None
    number: int = 0
    missing: tuple[float | str, ...] = ()


@dataclass(frozen=True)
class MeasurementMapping:
    """Meaning of a measurement file.

    Parameters
    ----------
    signals
        Requested columns; empty for all, under their own names and units.
    clock
        Source of the times; None if the file defines it.
    format
        Name of the file's format; empty to detect it from extension and content.
    decimal, skip_lines, titles, encoding
        See `ReadOptions`.
    missing
        Numbers and texts in the file that mark missing values, in addition to the usual ones.
    """

    signals: Mapping[str, SignalMapping] = field(default_factory=dict)
    clock: Clock | None = None
    format: str = ""
    decimal: str = ""
    skip_lines: int = 0
    titles: bool | None = None
    encoding: str = ""
    missing: tuple[float | str, ...] = ()

    @property
    def marks(self) -> tuple[str, ...]:
        """All cells of a text table that mark missing values."""
        every = (*self.missing, *(mark for s in self.signals.values() for mark in s.missing))
        return tuple(mark for mark in every if isinstance(mark, str))


# --- Mapping files: keys and values are checked strictly, and nothing is executed

_SIGNS = "1 or -1"
_Column = Annotated[
    str | Annotated[int, Field(ge=1, le=100_000)],
    Hint("write its title in quotation marks, or its number, counted from 1"),
]
_Rate = Annotated[float | None, Unit("Hz", 1e3), Field(gt=0)]
_Instant = Annotated[float | None, Unit("s")]
_Quoted = Annotated[str, Hint("write it in quotation marks")]
_Missing = Annotated[
    tuple[float | str, ...],
    Hint('write strings and numbers, such as ["NA", "OVLD", 9.9E37]'),
]


class TimeSection(Section):
    """A table ``time``: the time column, or the sample rate."""

    column: _Column = ""
    unit: _Quoted = ""
    rate: _Rate = None
    start: _Instant = None

    @classmethod
    def written_out(cls, content: Any) -> Any:
        """Expand a column's name to its table."""
        return {"column": content} if isinstance(content, (str, int)) else content


class _Marked(Section):
    """A section in which a single mark of missing values may stand without a list."""

    missing: _Missing = ()

    @classmethod
    def written_out(cls, content: Any) -> Any:
        """Return the table with its marks as a list."""
        if not isinstance(content, Mapping) or isinstance(content.get("missing", []), list):
            return content
        return {**content, "missing": [content["missing"]]}


class SignalSection(_Marked):
    """A section ``[signals.NAME]``; offset and limits are in the signal's unit."""

    column: _Column = ""
    unit: _Quoted = ""
    scale: Annotated[float | None, Unit("1")] = None
    sign: Annotated[int, Field(ge=-1, le=1), Hint(f"it must be {_SIGNS}")] = 1
    offset: Any = None
    delay: Annotated[float, Unit("s")] = 0.0
    limits: Any = None
    label: _Quoted = ""
    time: TimeSection | None = None
    rate: _Rate = None


class MappingFile(_Marked):
    """A mapping file."""

    format: _Quoted = ""
    time: TimeSection | None = None
    rate: _Rate = None
    start: _Instant = None
    signals: Annotated[Mapping[str, SignalSection], Field(default_factory=dict)]
    decimal: Annotated[Literal["", ".", ","], Hint("it must be '.' or ','")] = ""
    skip_lines: Annotated[int, Field(ge=0, le=10_000)] = 0
    titles: Annotated[
        bool | None, Hint("it must be true if the first row contains titles, otherwise false")
    ] = None
    encoding: _Quoted = ""


def mapping_from(content: Mapping[str, Any]) -> MeasurementMapping:
    """Return the mapping from tables of keys and values, as in a mapping file.

    Raises
    ------
    UnknownNameError
        For an unknown key, with the nearest known one.
    UnitError
        For a unit that is unknown or does not fit.
    ParameterError
        For a value out of range.
    """
    file = MappingFile.read(content, "a mapping")
    return MeasurementMapping(
        {name: _signal(name, each, f"[signals.{name}]") for name, each in file.signals.items()},
        _clock(file.time, file.rate, file.start, ""),
        file.format.strip(),
        file.decimal,
        file.skip_lines,
        file.titles,
        _encoding(file.encoding.strip().lower()),
        _marks(file.missing),
    )


def signal_mapping(name: str, content: Mapping[str, Any], place: str) -> SignalMapping:
    """Return the mapping of a signal from a section of another file.

    ``place``: name of the section in errors, such as ``"[stimulus]"``. Raises the errors of
    `mapping_from`.
    """
    return _signal(name, SignalSection.read(content, place), place)


def _encoding(name: str) -> str:
    encoding = {
        "utf8": "utf-8",
        "utf16": "utf-16",
        "latin1": "latin-1",
        "ansi": "cp1252",
        "iso-8859-1": "latin-1",
    }.get(name, name.replace("windows-", "cp"))
    if encoding and encoding not in ENCODINGS:
        raise unknown_of_few("encoding", encoding, ENCODINGS)
    return encoding


def _marks(missing: tuple[float | str, ...]) -> tuple[float | str, ...]:
    """Return the numbers and texts that mark missing values."""
    return tuple(mark.strip() if isinstance(mark, str) else mark for mark in missing)


def _signal(name: str, section: SignalSection, place: str) -> SignalMapping:
    where = f"{place} "
    unit = _unit(section.unit, where)
    symbol = si_symbol(unit_of(unit)) if unit else ""
    needs_unit = [key for key in ("offset", "limits") if key in section.given and not symbol]
    if needs_unit:
        text = f"{where}{needs_unit[0]} needs the signal's unit. Add the key unit"
        raise UnitError(text, name="unit")
    if section.scale == 0.0:
        raise not_valid(f"{where}scale", "0", "another number", "since 0 makes all values equal")
    if section.sign == 0:
        raise not_valid(f"{where}sign", "0", _SIGNS)
    number, column = _numbered(section.column)
    return SignalMapping(
        name=name,
        column=column or name,
        number=number,
        unit=unit,
        scale=section.scale,
        sign=section.sign,
        offset=0.0 if section.offset is None else _difference(section.offset, symbol, where),
        delay=section.delay,
        limits=None if section.limits is None else _limits(section.limits, symbol, where),
        label=section.label.strip(),
        clock=_clock(section.time, section.rate, None, where),
        missing=_marks(section.missing),
    )


def _limits(pair: Any, symbol: str, where: str) -> tuple[float, float]:
    if not isinstance(pair, list) or len(pair) != 2:
        raise not_valid(f"{where}limits", quoted(pair), 'two values, such as ["0 bar", "250 bar"]')
    low, high = (written(value, symbol, f"{where}limits") for value in pair)
    if not low < high:
        raise not_valid(f"{where}limits", quoted(pair), "in order, the lower value first")
    return low, high


def _difference(value: Any, symbol: str, where: str) -> float:
    """Return an offset; reject a unit with its own zero, such as degrees Celsius."""
    number = written(value, symbol, f"{where}offset")
    unit = units.split(value)[1] if isinstance(value, str) else ""
    if unit and units.has_own_zero(unit, symbol):
        raise UnitError(
            f"{where}offset = {quoted(value)} is ambiguous. Specify the difference in {symbol}",
            name="offset",
            value=quoted(value),
            valid=symbol,
        )
    return number


def _clock(
    time: TimeSection | None, rate: float | None, start: float | None, where: str
) -> Clock | None:
    """Return the clock from a table ``time``, or from ``rate`` and ``start``."""
    time = time or TimeSection()
    rate = time.rate if rate is None else rate
    start = time.start if start is None else start
    if not time.given and rate is None and start is None:
        return None
    number, column = _numbered(time.column)
    if bool(column) == (rate is not None):
        raise ParameterError(
            f"{where}needs either time or rate. For example, write "
            'time = { column = "t", unit = "ms" } or rate = "1 kHz"',
            name="time",
        )
    unit = _unit(time.unit, f"{where}time.")
    if unit and si_symbol(unit_of(unit)) != "s":
        raise UnitError(
            f"{where}time.unit = {quoted(unit)} is not a unit of time. For example, use 'ms'",
            name="time.unit",
            value=quoted(unit),
            valid="'ms'",
        )
    if column and start is not None:
        raise ParameterError(
            f"{where}start is valid only with a rate, because a time column defines its own times",
            name="start",
        )
    return Clock(column, unit, rate or 0.0, start or 0.0, number)


def _unit(text: str, where: str) -> str:
    try:
        if text:
            unit_of(text.strip())
    except UnitError as error:
        raise UnitError(
            f"{where}unit = {quoted(text)}: {error}. For example, use 'bar', or '1' for a pure "
            "number",
            name="unit",
            value=quoted(text),
        ) from None
    return text.strip()


def _numbered(column: str | int) -> tuple[int, str]:
    """Return the number of a column (0 if specified by title), and its title or number."""
    return (column, str(column)) if isinstance(column, int) else (0, column.strip())


def read_mapping(path: str | Path) -> MeasurementMapping:
    """Read a mapping file.

    Parameters
    ----------
    path
        TOML file with ``time`` or ``rate`` and a section ``[signals.NAME]`` for each signal.

    Raises
    ------
    FileError
        When the file cannot be read or is not valid TOML.
    InputError
        For content that is not valid, with the file's name in front.
    """
    file = Path(path)
    content = read_toml(file, "mapping")
    try:
        return mapping_from(content)
    except InputError as error:
        raise error.reworded(f"{file}: {error}") from None
