"""What the columns of a measurement file mean, and mapping files (TOML) that say it."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from bywire.core import units
from bywire.core.arguments import whole_number
from bywire.core.errors import (
    InputError,
    ParameterError,
    UnitError,
    quoted,
    unknown_name,
    unknown_of_few,
)
from bywire.data.column_units import si_symbol, unit_of
from bywire.data.text_encoding import ENCODINGS
from bywire.data.toml_file import read_toml


@dataclass(frozen=True)
class Clock:
    """Where the instants of signals come from: a column, or a sample rate.

    Parameters
    ----------
    column
        Column of the instants; empty where a rate is given.
    unit
        Its unit; empty where the file says it.
    rate
        Sample rate [Hz]; 0 where there is a column.
    start
        Instant of the first sample [s], of a rate.
    number
        Number of the column, from 1; 0 where its name tells it.
    """

    column: str = ""
    unit: str = ""
    rate: float = 0.0
    start: float = 0.0
    number: int = 0


@dataclass(frozen=True)
class SignalMapping:
    """What a column means: value = sign * scale * number [unit] + offset.

    Parameters
    ----------
    name
        Name of the signal.
    column
        Column of the file.
    unit
        Unit of the scaled number; empty where the file says it.
    scale, sign
        Factors of the number in the file; ``scale`` is None where the file's unit is to hold.
    offset
        Added to the value, in SI.
    delay
        How much later than the quantity the column shows it [s]: instants are moved back by it.
    limits
        Range of the sensor in SI, at whose ends it is clipped; None where it is not known.
    label
        Description, for figures.
    clock
        Where its instants come from; None for those of the whole file.
    number
        Number of the column, from 1; 0 where its name tells it.
    missing
        Numbers and texts in the file that say that nothing was measured.
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
    """What a measurement file means.

    Parameters
    ----------
    signals
        The columns that are wanted; empty for all of them, under their own names and units.
    clock
        Where the instants come from; None where the file says it.
    format
        Name of the file's format; empty where ending and content tell it.
    decimal, skip_lines, titles, encoding
        See `ReadOptions`.
    missing
        Numbers and texts in the file that say that nothing was measured, beside the usual ones.
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
        """Every cell of a text table that says that nothing was measured."""
        every = (*self.missing, *(mark for s in self.signals.values() for mark in s.missing))
        return tuple(mark for mark in every if isinstance(mark, str))


# --- Mapping files: strict about keys and values, and nothing is executed

_KEYS = (
    "format",
    "time",
    "rate",
    "start",
    "signals",
    "decimal",
    "skip_lines",
    "titles",
    "encoding",
    "missing",
)
_TIME_KEYS = ("column", "unit", "rate", "start")
_SIGNAL_KEYS = (
    "column",
    "unit",
    "scale",
    "sign",
    "offset",
    "delay",
    "limits",
    "label",
    "time",
    "rate",
    "missing",
)


def mapping_from(content: Mapping[str, Any]) -> MeasurementMapping:
    """Return the mapping that tables of keys and values describe, as a mapping file holds them.

    Raises
    ------
    UnknownNameError
        For an unknown key, with the nearest known one.
    UnitError
        For a unit that is not known or does not fit.
    ParameterError
        For a value that is not admissible.
    """
    _require_known(content, _KEYS, "key")
    signals = _table(content.get("signals", {}), "signals")
    decimal = _text(content, "decimal", "")
    if decimal not in ("", ".", ","):
        raise ParameterError(f"decimal = {decimal!r} is not admissible: it must be '.' or ','")
    skip = whole_number("skip_lines", content.get("skip_lines", 0), 0, 10_000)
    return MeasurementMapping(
        {n: _signal(n, _table(v, f"signals.{n}")) for n, v in signals.items()},
        _clock(content, ""),
        _text(content, "format", ""),
        decimal,
        skip,
        _titles(content),
        _encoding(content),
        _missing(content, ""),
    )


def _titles(content: Mapping[str, Any]) -> bool | None:
    titles = content.get("titles")
    if titles is not None and not isinstance(titles, bool):
        raise ParameterError(
            f"titles = {quoted(titles)} is not valid: it must be true or false, whether the first "
            "row holds titles"
        )
    return titles


def _encoding(content: Mapping[str, Any]) -> str:
    name = _text(content, "encoding", "").lower()
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


def _missing(table: Mapping[str, Any], where: str) -> tuple[float | str, ...]:
    """Return the numbers and texts that mark missing values."""
    marks = table.get("missing", [])
    marks = marks if isinstance(marks, list) else [marks]
    for mark in marks:
        is_huge = isinstance(mark, int) and mark.bit_length() > 1000
        if isinstance(mark, bool) or is_huge or not isinstance(mark, (int, float, str)):
            raise ParameterError(
                f"{where}missing = {quoted(table['missing'])} is not valid: write texts and "
                'numbers, as ["NA", "OVLD", 9.9E37]'
            )
    return tuple(mark.strip() if isinstance(mark, str) else float(mark) for mark in marks)


def _signal(name: str, table: Mapping[str, Any]) -> SignalMapping:
    where = f"signals.{name}."
    _require_known(table, _SIGNAL_KEYS, f"key in [signals.{name}]")
    unit = _unit(table, f"{where}unit")
    symbol = si_symbol(unit_of(unit)) if unit else ""
    needs_unit = [key for key in ("offset", "limits") if key in table and not symbol]
    if needs_unit:
        raise UnitError(f"{where}{needs_unit[0]} needs to know what is measured: give {where}unit")
    sign = table.get("sign", 1)
    if isinstance(sign, bool) or sign not in (1, -1):
        raise ParameterError(f"{where}sign = {quoted(sign)} is not admissible: it must be 1 or -1")
    return SignalMapping(
        name=name,
        column=_column(table, where) or name,
        number=_column_number(table, where),
        unit=unit,
        scale=_scale(table, where),
        sign=int(sign),
        offset=_difference(table["offset"], symbol, f"{where}offset") if "offset" in table else 0.0,
        delay=_quantity(table.get("delay", "0 s"), "s", f"{where}delay"),
        limits=_limits(table, symbol, f"{where}limits"),
        label=_text(table, "label", where),
        clock=_clock(table, where),
        missing=_missing(table, where),
    )


def _scale(table: Mapping[str, Any], where: str) -> float | None:
    if "scale" not in table:
        return None
    scale = units.parse(table["scale"], "1", f"{where}scale")
    if scale == 0.0:
        raise ParameterError(f"{where}scale = 0 is not admissible: every value would be the same")
    return scale


def _limits(table: Mapping[str, Any], symbol: str, name: str) -> tuple[float, float] | None:
    if "limits" not in table:
        return None
    pair = table["limits"]
    if not isinstance(pair, list) or len(pair) != 2:
        raise ParameterError(f'{name} = {quoted(pair)}: write two, as ["0 bar", "250 bar"]')
    low, high = (_quantity(value, symbol, name) for value in pair)
    if not low < high:
        raise ParameterError(f"{name} = {quoted(pair)} is not admissible: the lower one first")
    return low, high


def _difference(value: object, symbol: str, name: str) -> float:
    """Return an offset; one in degrees Celsius would count from another zero."""
    number = _quantity(value, symbol, name)
    unit = units.split(value)[1] if isinstance(value, str) else ""
    if unit and units.has_own_zero(unit, symbol):
        raise UnitError(f"{name} = {quoted(value)}: give the difference in {symbol}")
    return number


def _clock(table: Mapping[str, Any], where: str) -> Clock | None:
    """Return the clock of a table's keys ``time``, or ``rate`` and ``start``."""
    inner = table.get("time")
    rest = {key: table[key] for key in ("rate", "start") if key in table}
    if inner is None:
        inner, name = rest, where
    else:
        name = f"{where}time."
        inner = {"column": inner} if isinstance(inner, (str, int)) else inner
        inner = {**_table(inner, f"{where}time"), **rest}
    if not inner:
        return None
    _require_known(inner, _TIME_KEYS, f"key in {name.rstrip('.')}")
    column = _column(inner, name)
    if bool(column) == ("rate" in inner):
        raise ParameterError(
            f"{name}column or {name}rate: give one of them, as "
            'time = { column = "t", unit = "ms" } or rate = "1 kHz"'
        )
    unit = _unit(inner, f"{name}unit")
    if unit and si_symbol(unit_of(unit)) != "s":
        raise UnitError(f"{name}unit = {quoted(unit)} is no unit of time: write for instance 'ms'")
    if column and "start" in inner:
        raise ParameterError(f"{name}start goes with a rate: a column has its own instants")
    start = _quantity(inner.get("start", "0 s"), "s", f"{name}start")
    rate = 0.0
    if not column:
        rate = _quantity(inner["rate"], "Hz", f"{name}rate")
        if not rate > 0.0:
            raise ParameterError(
                f"{name}rate = {quoted(inner['rate'])} is not admissible: it must be > 0 Hz"
            )
    return Clock(column, unit, rate, start, _column_number(inner, name))


def _quantity(value: Any, symbol: str, name: str) -> float:
    """Return a quantity in SI; a plain number is refused where a unit is wanted, except 0."""
    if symbol != "1" and isinstance(value, (int, float)) and value != 0 and math.isfinite(value):
        raise UnitError(
            f"{name} = {value} has no unit: write for instance {units.example(symbol)!r}"
        )
    return units.parse(value, symbol, name)


def _unit(table: Mapping[str, Any], name: str) -> str:
    text = _text(table, "unit", name.removesuffix("unit"))
    try:
        if "unit" in table:
            unit_of(text)
    except UnitError as error:
        raise UnitError(
            f"{name} = {quoted(text)}: {error}: write for instance 'bar', or '1' for a pure number"
        ) from None
    return text


def _column(table: Mapping[str, Any], where: str) -> str:
    """Return the name of a column, or its number as a text."""
    return str(_column_number(table, where) or _text(table, "column", where))


def _column_number(table: Mapping[str, Any], where: str) -> int:
    """Return the number of a column, from 1; 0 where its name is given."""
    value = table.get("column", "")
    if not isinstance(value, int) or isinstance(value, bool):
        return 0
    if not 1 <= value <= 100_000:
        raise ParameterError(f"{where}column = {quoted(value)}: columns are counted from 1")
    return value


def _text(table: Mapping[str, Any], key: str, where: str) -> str:
    value = table.get(key, "")
    if not isinstance(value, str):
        raise ParameterError(f"{where}{key} = {quoted(value)}: write it in quotation marks")
    return value.strip()


def _table(value: Any, name: str) -> Mapping[str, Any]:
    if not isinstance(value, Mapping):
        raise ParameterError(f"{name} = {quoted(value)}: it must be a table of key = value")
    return value


def _require_known(table: Mapping[str, Any], known: Iterable[str], kind: str) -> None:
    names = tuple(known)
    for key in table:
        if key not in names:
            raise unknown_name(kind, key, names)


def read_mapping(path: str | Path) -> MeasurementMapping:
    """Read a mapping file.

    Parameters
    ----------
    path
        TOML file with ``time`` or ``rate`` and a section ``[signals.NAME]`` for each signal.

    Raises
    ------
    FileError
        When the file cannot be read or is no TOML.
    InputError
        For anything in it that does not fit, with the file's name in front.
    """
    file = Path(path)
    content = read_toml(file, "mapping")
    try:
        return mapping_from(content)
    except InputError as error:
        raise type(error)(f"{file}: {error}") from None
