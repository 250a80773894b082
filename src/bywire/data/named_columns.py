"""Columns specified on the command line, ``Pressure [psi]``, with or without a mapping file."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

from bywire.core.callers import is_command_line, option
from bywire.core.errors import FileError, InputError, ParameterError, UnitError, unknown_name
from bywire.core.quantities import display_unit
from bywire.core.typing import Progress
from bywire.core.units import parse
from bywire.data.column_choice import (
    MissingUnitsError,
    NoClockError,
    every_signal,
    left_out_note,
)
from bywire.data.column_units import split_title
from bywire.data.file_format import room
from bywire.data.mapping import Clock, MeasurementMapping, SignalMapping
from bywire.data.measurement import dataset_of, opened

if TYPE_CHECKING:
    import xarray as xr

_BRACKETS = "each with its column's unit in the brackets, or 1 for a pure number"


@dataclass(frozen=True)
class NamedColumns:
    """Columns that a user specifies in addition to a mapping file, or instead of it.

    Parameters
    ----------
    signals
        Name of the signal -> its column, with a unit in brackets if the file has none; or the
        name of a signal in the mapping file.
    time
        Time column, likewise; or a sample rate such as ``"1 kHz"``.
    units
        SI unit of every required signal, by name. bywire skips other columns without a unit. None
        if all columns are required.
    driving
        For inputs, name of the signal -> stimulus that it drives.
    """

    signals: Mapping[str, str] = field(default_factory=dict)
    time: str = ""
    units: Mapping[str, str] | None = None
    driving: Mapping[str, str] = field(default_factory=dict)


def reject_swapped(argument: str, columns: Mapping[str, str], known: Collection[str]) -> None:
    """Reject a pair of signal and column whose names are swapped, as in ``Pressure=p_set``.

    Parameters
    ----------
    argument
        Argument that contains the pairs, for the error.
    columns
        Column of each signal.
    known
        Valid names of signals.

    Raises
    ------
    ParameterError
        With the swapped form.
    """
    for name, column in columns.items():
        signal = split_title(column)[0]
        if name not in known and signal in known:
            right = option(argument, {signal: column.replace(signal, name, 1)})
            raise ParameterError(
                f"the signal must precede its column in {option(argument, {name: column})}. "
                f"Write {right}",
                name=argument,
                value=name,
                valid=right,
            )


def read_named(
    file: Path, meaning: MeasurementMapping, named: NamedColumns, progress: Progress
) -> tuple[xr.Dataset, tuple[str, ...]]:
    """Read the specified signals of a measurement file and all others, with notes.

    Parameters
    ----------
    file, meaning
        The file, and its mapping.
    named
        Columns that the user specifies.
    progress
        Called with a label and the finished share.

    Raises
    ------
    InputError
        As from `bywire.read_measurement`.
    """
    with opened(file, meaning) as source, _shown_units(named):
        meaning = _timed(meaning, named.time)
        signals = dict(meaning.signals) or {
            name: signal
            for name, signal in every_signal(file, source, meaning).items()
            if named.units is None or name in named.units or source.columns[signal.column].unit
        }
        signals |= {n: _signal(meaning, n, column) for n, column in named.signals.items()}
        whole = replace(meaning, signals=signals)
        dataset, notes = dataset_of(file, source, whole, None, progress, room())
        return dataset, notes if meaning.signals else (*notes, *left_out_note(source.left_out))


def read_wanted(
    file: Path, meaning: MeasurementMapping, wanted: Sequence[str], time: str, progress: Progress
) -> tuple[xr.Dataset, tuple[str, ...]]:
    """Read the requested signals of a measurement file, with notes.

    Parameters
    ----------
    file, meaning
        The file, and its mapping.
    wanted
        ``SIGNAL``, ``COLUMN``, ``COLUMN [unit]`` or ``SIGNAL=COLUMN [unit]``; all if empty.
    time
        See `NamedColumns`.
    progress
        Called with a label and the finished share.

    Raises
    ------
    InputError
        As from `bywire.read_measurement`.
    """
    with opened(file, meaning) as source, _shown_units(None):
        meaning = _timed(meaning, time)
        known = {**meaning.signals, **dict.fromkeys(source.columns if not meaning.signals else ())}
        named = dict(_named(text, known) for text in wanted)
        _reject_swapped_titles(named, known)
        is_mapped = bool(meaning.signals) and {*named} <= {*wanted}
        if named and not is_mapped:
            signals = {name: _signal(meaning, name, column) for name, column in named.items()}
            meaning = replace(meaning, signals=signals)
        return dataset_of(file, source, meaning, list(named) or None, progress, room())


def renamed(data: xr.Dataset, named: NamedColumns) -> xr.Dataset:
    """Return signals in memory under the user's names.

    Raises
    ------
    UnknownNameError
        When a signal is missing, with the nearest names.
    ParameterError
        When a time column is specified, since signals in memory already have times.
    """
    if named.time:
        raise ParameterError(
            f"{option('time')} is valid only for measurement files. Remove it", name="time"
        )
    for name, column in named.signals.items():
        if column not in data:
            raise unknown_name("signal", column, [str(each) for each in data.data_vars])
        data = data.assign({name: data[column]})
    return data


def _reject_swapped_titles(columns: Mapping[str, str], known: Mapping[str, object]) -> None:
    for name, column in columns.items():
        if name != column and name in known and not {column, split_title(column)[0]} & {*known}:
            right = f"{column}={name}"
            raise ParameterError(
                f"the signal must precede its column in {name}={column}. Write {right}",
                name="signals",
                value=name,
                valid=right,
            )


def _named(text: str, known: Mapping[str, object]) -> tuple[str, str]:
    """Return name and column of a requested signal."""
    if text in known:
        return text, text
    name, equals, column = (part.strip() for part in text.partition("="))
    if equals and name and column:
        return name, column
    return split_title(text)[0], text


def _signal(meaning: MeasurementMapping, name: str, column: str) -> SignalMapping:
    known = meaning.signals.get(column)
    return SignalMapping(name, column) if known is None else replace(known, name=name)


def _timed(meaning: MeasurementMapping, time: str) -> MeasurementMapping:
    """Return a mapping with times from a column or a sample rate."""
    if not time:
        return meaning
    try:
        rate = parse(time, "Hz", option("time")) if time[0].isdigit() and " " in time else 0.0
    except InputError:
        rate = 0.0
    return replace(meaning, clock=Clock(rate=rate) if rate > 0.0 else Clock(column=time))


@contextmanager
def _shown_units(named: NamedColumns | None) -> Iterator[None]:
    """Add to errors what to type for columns without a unit; None for a list of signals."""
    try:
        yield
    except MissingUnitsError as error:
        typed = _options(error.signals, error.clock, named)
        raise UnitError(f"{error.lacking}. Use {typed}, {_BRACKETS}", name="unit") from None
    except NoClockError as error:
        typed = _options(error.signals, "COLUMN", named)
        rate = '--time "1 kHz"' if is_command_line() else "time='1 kHz'"
        raise FileError(
            f"{error}. Alternatively, use {typed}, {_BRACKETS}. For a constant sample rate, use "
            f"{rate}",
            name="time",
        ) from None


def _options(signals: Mapping[str, str], clock: str, named: NamedColumns | None) -> str:
    """Return the options, or in Python the arguments, that specify the units of columns.

    Parameters
    ----------
    signals
        Name of each signal without a unit -> its column.
    clock
        Time column, if it has no unit.
    named
        Columns that the user specified; None for a list of signals.
    """
    groups: dict[str, dict[str, str]] = {}
    for name, column in signals.items():
        unit = ((named.units or {}).get(name) if named else None) or ""
        text = f"{column} [{display_unit(unit) or 'UNIT'}]"
        driven = named.driving.get(name) if named else None
        group = "signals" if named is None else "outputs" if driven is None else "inputs"
        groups.setdefault(group, {})[driven or name] = text
    if named is not None and named.units is not None and not {*signals} & {*named.units}:
        any_column = "COLUMN [UNIT]"  # no column has a name from the model
        groups = {"inputs": {"STIMULUS": any_column}, "outputs": {"SIGNAL": any_column}}
    of_command = is_command_line()
    texts = []
    for group, pairs in groups.items():
        if group == "signals":
            each = [t if t.startswith(f"{n} [") else f"{n}={t}" for n, t in pairs.items()]
            texts.append(f'--signals "{", ".join(each)}"' if of_command else f"signals={each}")
        elif of_command:
            texts += [f'{option(group)} {name}="{text}"' for name, text in pairs.items()]
        else:
            texts.append(f"{group}={pairs}")
    if clock:
        texts.append(f'--time "{clock} [s]"' if of_command else f"time='{clock} [s]'")
    return (" " if of_command else ", ").join(texts)
