"""Read a measured trace, for instance of a rider's pedal, out of any measurement file.

A trace drives a model, so it has to be whole: where nothing was measured, or for longer than a
pause that is allowed, it is refused, never bridged in silence. In a text table a first row
``time [s], pedal [mm]`` says names and units; a mapping says them for other files.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from bywire.core import units
from bywire.core.errors import FileError, ParameterError, UnitError, quoted
from bywire.core.quantities import display_unit
from bywire.data.column_choice import every_signal
from bywire.data.column_units import measures, unit_of_symbol
from bywire.data.file_format import Source, no_progress
from bywire.data.format_registry import FORMATS, format_to_read, head_of
from bywire.data.mapping import MeasurementMapping, SignalMapping
from bywire.data.measurement import MeasurementWarning, dataset_of, mapping_of, opened
from bywire.data.room import room

_GAP = 10.0  # median steps: a pause must be longer to count as a gap

Meaning = MeasurementMapping | Mapping[str, Any] | str | Path | None
"""what columns mean: a mapping, its tables, the path of a mapping file, or nothing"""


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
        Needed signals and the SI unit of each, for instance ``{"pedal": "m"}``: those of the
        mapping, or else columns, capitals or not. Without it all are read, each in the SI unit of
        its quantity.
    max_gap
        Longest pause between two instants, text with a unit or [s]. A longer one is refused when
        it is longer than ten median steps too.
    mapping
        What the columns mean, where the file does not say it.

    Returns
    -------
    xarray.Dataset
        As of `read_measurement`; every number is there.

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
        raise ParameterError(f"max_gap = {max_gap!r} is not valid: it must be > 0 s")
    file = Path(path)
    meaning = _meaning(file, mapping)
    with opened(file, meaning) as source:
        names = tuple(signals) if signals is not None else _names(file, source, meaning)
        chosen = {n: _chosen(file, source, meaning, n) for n in names}
        whole, notes = dataset_of(
            file, source, replace(meaning, signals=chosen), None, no_progress, room()
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
    """Return the names of a trace's signals, time left out; numbers are not looked at.

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
    """Return what a mapping says; a trace may be a text table whatever its name ends with."""
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
            f"{file}: none of its columns {quoted(there)} beside time has a name: add a first row, "
            "as 'time [s], pedal [mm]', or say in a mapping what they are"
        )
    return names


def _chosen(file: Path, source: Source, meaning: MeasurementMapping, name: str) -> SignalMapping:
    """Return what a signal's column means, whose name may be in other capitals."""
    said = meaning.signals.get(name) or SignalMapping(name, name.strip())
    if said.column in source.columns and meaning.signals:
        return said
    near = [c for c in source.columns if c.casefold() == said.column.casefold()]
    if len(near) > 1:
        raise FileError(
            f"{file}, column {quoted(said.column)}: the name stands twice, capitals or not: rename "
            "one of them"
        )
    return replace(said, column=near[0]) if near else said


def _require_quantity(file: Path, source: Source, signal: xr.DataArray, symbol: str) -> None:
    if not measures(unit_of_symbol(signal.attrs["units"]), symbol):
        column = signal.attrs["column"]
        unit = source.columns[column].unit or signal.attrs["units"]
        raise UnitError(
            f"{file}, column {quoted(column)}: {quoted(unit)} has the wrong unit, it cannot be "
            f"{symbol}: choose a column in {display_unit(symbol)} or a unit like it"
        )
    signal.attrs["units"] = symbol


def _require_whole(file: Path, source: Source, signal: xr.DataArray, longest: float) -> None:
    """Refuse numbers that are missing, and pauses that are too long."""
    column = signal.attrs["column"]
    missing = np.flatnonzero(np.isnan(signal.values))
    if missing.size:
        raise FileError(
            f"{file}, {source.place(column, int(missing[0]))}, column {quoted(column)}: blank or "
            "NaN is no measured value: fill it in or remove the row"
        )
    time = signal[signal.dims[0]].values
    steps = np.diff(time)
    gaps = np.flatnonzero((steps > _GAP * np.median(steps)) & (steps > longest))
    if gaps.size:
        k = int(gaps[0])
        most = float(np.max(steps[gaps]))
        raise FileError(
            f"{file}, {source.place(column, k + 1)}: a gap of {steps[k]:.4g} s after "
            f"{time[k]:.6g} s ({gaps.size} in the file, the longest {most:.4g} s; max_gap is "
            f"{longest:g} s): fill it in, or, if a straight line across it is what you want, allow "
            f'it with max_gap="{1.01 * most:.3g} s"'
        )
