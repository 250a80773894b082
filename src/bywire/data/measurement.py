"""Measurement files as datasets in SI: every signal at the times at which it was measured.

Signals that were measured at the same times share a dimension. The dimension of most signals is
``time``; others have ``time_NAME``, with the name of their first signal. This module does not
resample: `bywire.data.alignment.resample` brings signals to one time axis, with a report.
"""

from __future__ import annotations

import warnings
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import NDArray

from bywire.core import units
from bywire.core.arguments import checked
from bywire.core.errors import FileError, InputError, ParameterError, UnitError, not_valid, quoted
from bywire.core.quantities import display_unit
from bywire.core.typing import Progress, silent
from bywire.data.column_choice import Chosen, choose, every_signal, left_out_note
from bywire.data.column_units import convert_in_place, measures, unit_of, unit_of_symbol
from bywire.data.file_format import ReadOptions, Source, require_room, room
from bywire.data.format_registry import FORMATS, format_to_read, head_of
from bywire.data.limited_source import limited
from bywire.data.mapping import Clock, MeasurementMapping, SignalMapping, mapping_from, read_mapping

if TYPE_CHECKING:
    import xarray as xr

_BLOCK = 1 << 20  # times per chunk, since their differences need memory


@dataclass(frozen=True)
class _AxisKey:
    """Properties that distinguish time axes.

    Parameters
    ----------
    clock
        Source of the times.
    length
        Number of samples.
    delay
        Time by which the samples are moved to earlier times [s].
    """

    clock: Clock
    length: int
    delay: float


def instants(
    file: Path, source: Source, key: _AxisKey, column: NDArray[np.float64] | None
) -> NDArray[np.float64]:
    """Return the times of an axis [s], shape ``(sample,)``, in increasing order.

    Parameters
    ----------
    file, source
        File and open source, for errors.
    key
        Key of the axis.
    column
        Numbers of the time column, converted to times in place; None for a rate.

    Raises
    ------
    FileError
        When times are missing or do not increase, with the place; when there are too few, or
        their number differs from that of the samples.
    """
    clock = key.clock
    if column is None:
        time = np.arange(key.length, dtype=np.float64)
        time /= clock.rate
        time += clock.start - key.delay
    else:
        if column.size != key.length:
            raise FileError(
                f"{file}: the time column {clock.column!r} has {column.size} values, but its "
                f"signals have {key.length} samples. Specify each signal's own time column in a "
                'mapping, for example [signals.NAME] time = { column = "t" }',
                name=clock.column,
                value=str(column.size),
                valid=str(key.length),
            )
        time = _measured(file, source, clock, column)
        if key.delay:
            time -= key.delay
    if time.size < 2:
        raise FileError(
            f"{file} has too few rows ({time.size}). It needs at least two",
            name=str(file),
            value=str(time.size),
        )
    return time


def _measured(
    file: Path, source: Source, clock: Clock, column: NDArray[np.float64]
) -> NDArray[np.float64]:
    # In a table, the column of a slower clock ends earlier, and the cells below it are blank.
    time = column[: _filled(column)]
    bad = _first_not_increasing(time)
    if bad is not None:
        where = f"{file}, column {clock.column!r}, {source.place(clock.column, bad)}"
        now, before = float(time[bad]), float(time[bad - 1]) if bad else np.nan
        if np.isfinite(now):
            what = "is repeated" if now == before else f"comes after {before:.10g}"
            fix = "Time must increase. Sort the rows, and remove repeated ones"
        else:
            what, fix = "is not a time", "Remove the row"
        value = f"{now:.10g} {clock.unit}"
        raise FileError(f"{where}: {value} {what}. {fix}", name=clock.column, value=value)
    convert_in_place(time, unit_of(clock.unit), "s")
    return time


def _filled(column: NDArray[np.float64]) -> int:
    """Return the number of values up to the last one that is not NaN."""
    end = column.size
    while end:
        begin = max(0, end - _BLOCK)
        there = np.flatnonzero(~np.isnan(column[begin:end]))
        if there.size:
            return begin + int(there[-1]) + 1
        end = begin
    return 0


def _first_not_increasing(time: NDArray[np.float64]) -> int | None:
    """Return the first index whose time is not later than the previous one, or None."""
    if time.size and not np.isfinite(time[0]):
        return 0
    for begin in range(0, time.size - 1, _BLOCK):
        part = time[begin : begin + _BLOCK + 1]
        bad = np.flatnonzero(~(np.diff(part) > 0) | ~np.isfinite(part[1:]))
        if bad.size:
            return begin + int(bad[0]) + 1
    return None


# --- Measurements


class MeasurementWarning(UserWarning):
    """A note on how a measurement file was read."""


@checked
def read_measurement(
    path: str | Path,
    mapping: MeasurementMapping | Mapping[str, Any] | str | Path | None = None,
    *,
    signals: Sequence[str] | None = None,
    progress: Progress = silent,
    largest: int | None = None,
) -> xr.Dataset:
    """Read a measurement file.

    Parameters
    ----------
    path
        CSV, TSV, Parquet, MAT (5 or 7.3), ASAM MDF 4 or NetCDF file.
    mapping
        Meaning of its columns: a mapping, its tables, or the path of a mapping file. Without a
        mapping, bywire reads every column under its own name; the file must then contain units
        and times.
    signals
        Names of the signals to read. Default: all in the mapping.
    progress
        Callback with a label and the finished share.
    largest
        Limit for the bytes of numbers, checked before reading: 8 GiB by default, or half the
        machine's memory. The size of a text table is known only after reading.

    Returns
    -------
    xarray.Dataset
        Variables of shape ``(time,)``, or ``(time_NAME,)`` for signals with other times. Their
        attributes are ``units`` (SI), ``long_name``, ``column`` and, if known, ``delay`` [s],
        ``valid_min`` and ``valid_max``; those of the dataset are ``source`` and ``format``.
        Missing values are NaN. A `MeasurementWarning` reports skipped, missing and guessed items.

    Raises
    ------
    FileError
        When the file cannot be read, is damaged, or does not match its name.
    UnknownNameError
        For an unknown column, signal or format, with the nearest names.
    UnitError
        When a unit is missing or unknown, or contradicts the unit in the file.
    ParameterError
        When an entry of the mapping is not valid.
    """
    dataset, notes = read_with_notes(
        path, mapping, signals=signals, progress=progress, largest=largest
    )
    for note in notes:
        warnings.warn(f"{Path(path).name}: {note}", MeasurementWarning, stacklevel=2)
    return dataset


def read_with_notes(
    path: str | Path,
    mapping: MeasurementMapping | Mapping[str, Any] | str | Path | None = None,
    *,
    signals: Sequence[str] | None = None,
    progress: Progress = silent,
    largest: int | None = None,
) -> tuple[xr.Dataset, tuple[str, ...]]:
    """Read a measurement file, and also return notes on it.

    Otherwise like `read_measurement`, which issues the notes as warnings.
    """
    file = Path(path)
    meaning = mapping_of(mapping)
    with opened(file, meaning) as source:
        return dataset_of(
            file, source, meaning, signals, progress, room() if largest is None else largest
        )


def dataset_of(
    file: Path,
    source: Source,
    meaning: MeasurementMapping,
    signals: Sequence[str] | None,
    progress: Progress,
    largest: int,
) -> tuple[xr.Dataset, tuple[str, ...]]:
    """Read signals of an open measurement file, as `read_with_notes` does."""
    chosen = choose(file, source, meaning, signals)
    names = {c.column for c in chosen} | {c.clock.column for c in chosen if c.clock.column}
    require_room(file, source, names, largest)
    dataset, notes = _dataset(file, source, chosen, progress)
    dataset.attrs = {"source": file.name, "format": format_to_read(file, meaning.format).name}
    every = signals is None and not meaning.signals
    left_out = left_out_note(source.left_out) if every else []
    return dataset, (*source.remarks, *left_out, *notes)


@contextmanager
def opened(file: Path, meaning: MeasurementMapping) -> Iterator[Source]:
    """Open a measurement file, in a child process if a library reads it.

    Raises
    ------
    FileError
        When the file cannot be read, is damaged, or does not match its name; also from operations
        on the open file.
    """
    kind = format_to_read(file, meaning.format)
    try:
        if kind.libraries:
            with limited(file, kind) as source:
                yield source
        else:
            options = ReadOptions(
                meaning.decimal, meaning.skip_lines, meaning.titles, meaning.encoding, meaning.marks
            )
            with kind.open(file, options) as plain:
                yield cast(Source, plain)
    except InputError:
        raise
    except MemoryError:
        raise FileError(
            f"{file} does not fit into memory. Read fewer signals at a time", name=str(file)
        ) from None
    except OSError as error:
        reason = error.strerror or str(error)
        raise FileError(
            f"{file} cannot be read ({reason}). It may be damaged or incomplete", name=str(file)
        ) from None


def mapping_of(
    mapping: MeasurementMapping | Mapping[str, Any] | str | Path | None,
) -> MeasurementMapping:
    """Return a mapping from itself, its tables, or a mapping file."""
    if isinstance(mapping, MeasurementMapping):
        return mapping
    if isinstance(mapping, Mapping):
        return mapping_from(mapping)
    return MeasurementMapping() if mapping is None else read_mapping(mapping)


def _dataset(
    file: Path, source: Source, chosen: Sequence[Chosen], progress: Progress
) -> tuple[xr.Dataset, list[str]]:
    import pandas as pd  # slow to load, like xarray
    import xarray as xr

    clocks = [c.clock.column for c in chosen if c.clock.column]
    names = list(dict.fromkeys([*clocks, *(c.column for c in chosen)]))
    values = source.read(names, progress)
    keys = [_AxisKey(c.clock, len(values[c.column]), c.mapping.delay) for c in chosen]
    dims = _dimensions(chosen, keys)
    # Numbers are converted to SI in place, unless they are needed again unconverted.
    uses = Counter([c.column for c in chosen] + [k.clock.column for k in dims])
    axes = {}
    for key in dims:
        column = _taken(values, uses, key.clock.column) if key.clock.column else None
        axes[key] = instants(file, source, key, column)
    variables = {}
    notes: list[str] = []
    for signal, key in zip(chosen, keys, strict=True):
        numbers = _timed(file, signal, _taken(values, uses, signal.column), axes[key].size)
        notes += signal.to_si(numbers)
        variables[signal.mapping.name] = (dims[key], numbers, signal.attributes())
    # Indexes of pandas share the array; from the array itself, xarray would make a copy.
    coords: dict[str, Any] = {
        dims[key]: (
            dims[key],
            pd.Index(axis, copy=False, name=dims[key]),
            {"units": "s", "long_name": "time"},
        )
        for key, axis in axes.items()
    }
    return xr.Dataset(variables, coords=coords), notes


def _taken(
    values: dict[str, NDArray[np.float64]], uses: Counter[str], name: str
) -> NDArray[np.float64]:
    """Return numbers that may be changed: a copy, or the numbers themselves at their last use."""
    uses[name] -= 1
    return values[name].copy() if uses[name] else values.pop(name)


def _timed(
    file: Path, signal: Chosen, numbers: NDArray[np.float64], count: int
) -> NDArray[np.float64]:
    """Return the numbers that have a time; cells after the end of a clock must be blank."""
    if not np.isnan(numbers[count:]).all():
        raise FileError(
            f"{file}: the column {signal.column!r} has numbers after the last time in "
            f"{signal.clock.column!r}. Specify its own time column in a mapping",
            name=signal.column,
        )
    return numbers[:count]


def _dimensions(chosen: Sequence[Chosen], keys: Sequence[_AxisKey]) -> dict[_AxisKey, str]:
    """Return the dimension of every time axis; that of most signals is ``time``."""
    main = Counter(keys).most_common(1)[0][0]
    dimensions: dict[_AxisKey, str] = {main: "time"}
    for signal, key in zip(chosen, keys, strict=True):
        dimensions.setdefault(key, f"time_{signal.mapping.name}")
    for signal in chosen:
        if signal.mapping.name in dimensions.values():
            raise ParameterError(
                f"signal {quoted(signal.mapping.name)} has the same name as a time axis. "
                "Choose another name in a mapping",
                name=signal.mapping.name,
            )
    return dimensions


# --- A single trace, for example of a rider's pedal
# A trace drives a model, so it must be complete: missing values and long pauses raise an error, and
# bywire never bridges them silently. In a text table, a first row ``time [s], pedal [mm]`` contains
# names and units. For other files, a mapping contains them.

_GAP = 10.0  # median steps: a pause must be longer to be treated as a gap

Meaning = MeasurementMapping | Mapping[str, Any] | str | Path | None
"""meaning of columns: a mapping, its tables, the path of a mapping file, or None"""


def read_trace(
    path: str | Path,
    signals: Mapping[str, str] | None = None,
    *,
    max_gap: str | float = 0.1,
    mapping: Meaning = None,
) -> xr.Dataset:
    """Return columns of a measurement file as signals over time, SI inside.

    Parameters
    ----------
    path
        The file.
    signals
        Required signals and their SI units, for example ``{"pedal": "m"}``: signals of the
        mapping, or columns, ignoring case. Default: all columns, each in the SI unit of its
        quantity.
    max_gap
        Maximum pause between two samples, text with a unit or [s]. A longer pause is an error if
        it also exceeds ten median steps.
    mapping
        Meaning of the columns, if it is not in the file.

    Returns
    -------
    xarray.Dataset
        As from `read_measurement`, but without missing numbers.

    Raises
    ------
    FileError
        When the file cannot be read or parsed, with file, line, column, value and next step.
    UnitError
        When a unit is missing, unknown, or of another dimension.
    ParameterError
        When ``max_gap`` is not a positive duration.
    """
    longest = units.parse(max_gap, "s", "max_gap")
    if not longest > 0:
        raise not_valid("max_gap", repr(max_gap), "> 0 s")
    file = Path(path)
    meaning = _meaning(file, mapping)
    with opened(file, meaning) as source:
        names = tuple(signals) if signals is not None else _names(file, source, meaning)
        chosen = {n: _chosen(file, source, meaning, n) for n in names}
        whole, notes = dataset_of(
            file, source, replace(meaning, signals=chosen), None, silent, room()
        )
        for name, symbol in (signals or {}).items():
            _require_quantity(file, source, whole[name], symbol)
        for signal in whole.data_vars.values():
            _require_whole(file, source, signal, longest)
    whole.attrs["source"] = file.name
    for note in notes:
        warnings.warn(f"{file.name}: {note}", MeasurementWarning, stacklevel=2)
    return whole


def trace_names(path: str | Path, mapping: Meaning = None) -> tuple[str, ...]:
    """Return the names of a trace's signals except time, without reading numbers.

    Raises
    ------
    FileError
        When the file cannot be read.
    """
    file = Path(path)
    meaning = _meaning(file, mapping)
    with opened(file, meaning) as source:
        return _names(file, source, meaning)


def _meaning(file: Path, mapping: Meaning) -> MeasurementMapping:
    """Return the mapping of a trace, which may be a text table with any file extension."""
    meaning = mapping_of(mapping)
    if not meaning.format and FORMATS.find("csv").recognizes(head_of(file)):
        return replace(meaning, format="csv")
    format_to_read(file, meaning.format)
    return meaning


def _names(file: Path, source: Source, meaning: MeasurementMapping) -> tuple[str, ...]:
    """Return the names of the mapping's signals, or of columns with a title."""
    if meaning.signals:
        return tuple(meaning.signals)
    columns = every_signal(file, source, meaning)
    names = tuple(n for n in columns if not (n.isdecimal() and not source.columns[n].unit))
    if not names:
        there = ", ".join(source.columns)
        raise FileError(
            f"{file}: the columns {quoted(there)} have no names. Add a first row such as "
            "'time [s], pedal [mm]', or specify names in a mapping",
            name=str(file),
        )
    return names


def _chosen(file: Path, source: Source, meaning: MeasurementMapping, name: str) -> SignalMapping:
    """Return the mapping of a signal's column, ignoring case."""
    signal = meaning.signals.get(name) or SignalMapping(name, name.strip())
    if signal.column in source.columns and meaning.signals:
        return signal
    near = [c for c in source.columns if c.casefold() == signal.column.casefold()]
    if len(near) > 1:
        raise FileError(
            f"{file} has two columns named {quoted(signal.column)} (case is ignored). Rename one "
            "of them",
            name=signal.column,
        )
    return replace(signal, column=near[0]) if near else signal


def _require_quantity(file: Path, source: Source, signal: xr.DataArray, symbol: str) -> None:
    if not measures(unit_of_symbol(signal.attrs["units"]), symbol):
        column = signal.attrs["column"]
        unit = source.columns[column].unit or signal.attrs["units"]
        raise UnitError(
            f"{file}, column {quoted(column)}: {quoted(unit)} cannot be converted to {symbol}. "
            f"Choose a column in {display_unit(symbol)}, or in another unit of this quantity",
            name=column,
            value=unit,
            valid=symbol,
        )
    signal.attrs["units"] = symbol


def _require_whole(file: Path, source: Source, signal: xr.DataArray, longest: float) -> None:
    """Reject missing numbers, and pauses that are too long."""
    column = signal.attrs["column"]
    missing = np.flatnonzero(np.isnan(signal.values))
    if missing.size:
        raise FileError(
            f"{file}, {source.place(column, int(missing[0]))}, column {quoted(column)}: the value "
            "is missing (blank or NaN). Fill it in, or remove the row",
            name=column,
        )
    time = signal[signal.dims[0]].values
    steps = np.diff(time)
    gaps = np.flatnonzero((steps > _GAP * np.median(steps)) & (steps > longest))
    if gaps.size:
        k = int(gaps[0])
        most = float(np.max(steps[gaps]))
        raise FileError(
            f"{file}, {source.place(column, k + 1)}: a gap of {steps[k]:.4g} s after "
            f"{time[k]:.6g} s exceeds max_gap = {longest:g} s ({gaps.size} in the file, the "
            f"longest {most:.4g} s). Fill it in, or bridge it with a straight line: "
            f'max_gap="{1.01 * most:.3g} s"',
            name="max_gap",
            value=f"{longest:g} s",
            valid=f"{1.01 * most:.3g} s",
        )
