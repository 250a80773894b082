"""Columns of a measurement, with a first plot and units to choose from."""

from __future__ import annotations

import os
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bywire.core.errors import BywireError, FileError, InputError
from bywire.core.model import Model
from bywire.core.quantities import display_unit
from bywire.core.scratch import scratch_folder
from bywire.core.signals import Signal, signals_of
from bywire.core.typing import silent
from bywire.core.unit_list import units_by_symbol
from bywire.data.column_choice import left_out_note, usual_clock
from bywire.data.file_format import Source
from bywire.data.format_registry import format_to_read
from bywire.data.mapping import MeasurementMapping
from bywire.data.measurement import opened
from bywire.server.place import Place

_LARGEST_TEXT = 20_000_000  # bytes of a text table that a first plot reads
_LARGEST = 400_000_000  # bytes of numbers that a first plot reads
_MOST = 60  # columns with a plot
_BINS = 400  # points of a curve; each has a minimum and a maximum


def shown_columns(place: Place, file: Path) -> dict[str, Any]:
    """Return the columns of a measurement file, with the points of a first plot.

    Parameters
    ----------
    place, file
        The served folder, and a file in it.

    Returns
    -------
    dict
        ``file``; ``clock``: the column that contains the times, or empty; ``notes``; and
        ``columns``: each has ``name``, ``unit`` as the file states it, ``length``, ``clock`` if the
        file states one, ``low`` and ``high`` by bin, and ``first``, its value at each bin's start.

    Raises
    ------
    FileError
        If the file cannot be read.
    """
    with scratch_folder(place.root) as scratch:
        try:
            head, notes = _head(file, scratch)
            with opened(head, MeasurementMapping()) as source:
                shown = _columns(source)
        except InputError as error:
            text = str(error).replace(f"{scratch}{os.sep}", "")
            raise FileError(text.replace(f"{place.root}{os.sep}", "")) from None
    return {"file": place.named(file), **shown, "notes": [*notes, *shown["notes"]]}


def _head(file: Path, scratch: Path) -> tuple[Path, list[str]]:
    """Return the file, or the first part of a large text table with a note."""
    if format_to_read(file).libraries or file.stat().st_size <= _LARGEST_TEXT:
        return file, []
    with file.open("rb") as whole:
        part = whole.read(_LARGEST_TEXT)
    head = scratch / file.name
    head.write_bytes(part[: part.rfind(b"\n") + 1] or part)  # the last line may be incomplete
    return head, [f"The plot shows the first {_LARGEST_TEXT / 1e6:.0f} MB of the file."]


def _columns(source: Source) -> dict[str, Any]:
    names, size = list[str](), 0
    for name, column in source.columns.items():
        size += 8 * (column.length or 0)
        if len(names) < _MOST and size <= _LARGEST:
            names.append(name)
    values = source.read(names, silent)
    notes = [*source.remarks, *left_out_note(source.left_out)]
    if left := len(source.columns) - len(names):
        notes.append(f"{left} more columns are not plotted.")
    usual = usual_clock(source) or next((n for n in names if _increases(values[n])), "")
    columns = [
        {
            "name": name,
            "unit": column.unit,
            "clock": column.clock or "",
            "length": int(values[name].size) if name in values else column.length,
            **(_points(values[name]) if name in values else {"low": [], "high": [], "first": []}),
        }
        for name, column in source.columns.items()
    ]
    return {"clock": usual, "columns": columns, "notes": notes}


def _increases(values: NDArray[np.float64]) -> bool:
    """Return whether values can be times."""
    there = values[~np.isnan(values)]
    return there.size > 1 and bool((np.diff(there) > 0.0).all())


def _points(values: NDArray[np.float64]) -> dict[str, list[float]]:
    """Return the minimum, the maximum and the first value of each bin of rows."""
    if not values.size:
        return {"low": [], "high": [], "first": []}
    finite = np.where(np.isfinite(values), values, np.nan)
    starts = np.unique(np.linspace(0, values.size, min(_BINS, values.size) + 1).astype(int)[:-1])
    return {
        "low": _rounded(np.fmin.reduceat(finite, starts), 6),
        "high": _rounded(np.fmax.reduceat(finite, starts), 6),
        "first": _rounded(np.append(finite[starts], finite[-1]), 12),
    }


def _rounded(values: NDArray[np.float64], digits: int) -> list[float]:
    return [float(f"{value:.{digits}g}") for value in values]


# --- Meanings of columns


def meanings_for(bench: Path | None, method: str) -> dict[str, Any]:
    """Return the signals of a bench or an identification method that columns may contain.

    Returns
    -------
    dict
        ``inputs`` and ``outputs``: each signal has ``name``, ``label`` and ``symbol``, its SI unit.
        ``units``: the units to choose from by SI unit, with the usual unit first.
    """
    inputs, outputs = _signals_of_bench(bench) if bench else ([], _signals_of_method(method))
    symbols = [each["symbol"] for each in (*inputs, *outputs)]
    units = {symbol: choosable(symbol) for symbol in [*symbols, *_listed()] if symbol}
    return {"inputs": inputs, "outputs": outputs, "units": units}


def _signals_of_bench(bench: Path) -> tuple[list[dict[str, str]], list[dict[str, str]]]:
    from bywire.api.replay import driven_bench
    from bywire.identification.bench_replay import case_of

    try:
        model: Model = case_of(driven_bench(bench, {}), "").model
    except BywireError:  # the form shows the error when the user sends it
        return [], []
    inputs, outputs = (_described(signals_of(kind)) for kind in (model.Stimulus, model.Output))
    return [each for each in inputs if not each["name"].startswith("noise_")], outputs


def _signals_of_method(method: str) -> list[dict[str, str]]:
    from bywire.identification.method import METHODS

    known = METHODS.all().get(method)
    signals = {} if known is None else {**known.signals, **known.optional}
    return [{"name": name, "label": "", "symbol": unit} for name, unit in signals.items()]


def _described(signals: Mapping[str, Signal]) -> list[dict[str, str]]:
    return [
        {"name": name, "label": each.label, "symbol": each.unit}
        for name, each in signals.items()
        if each.role is None  # measurements contain no energies
    ]


@cache
def _listed() -> Mapping[str, list[str]]:
    return units_by_symbol()


def choosable(symbol: str) -> list[str]:
    """Return the units to choose from for a quantity, with the usual unit first.

    Examples
    --------
    >>> choosable("rad/s")[:3], choosable("Pa")[0]
    (['rad/s', 'rpm', 'krpm'], 'bar')
    """
    above, slash, below = symbol.rpartition("/")
    rates = [f"{unit}/s" for unit in _listed().get(above, [])] if slash and below == "s" else []
    first = [display_unit(symbol), symbol]
    return list(dict.fromkeys([*first, *_listed().get(symbol, []), *rates]))
