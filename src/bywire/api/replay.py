"""A measured demand drives a bench's model, and what it gives is laid beside the measurement."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

import xarray as xr

from bywire.bench import bench_file
from bywire.bench.bench import Bench
from bywire.core.callers import option
from bywire.core.errors import ParameterError
from bywire.core.model import Model
from bywire.core.signals import signals_of
from bywire.data.named_columns import NamedColumns
from bywire.identification.replaying.segments import (
    Segment,
    found_in,
    read_segments,
    whole_record,
)

_NONE: Mapping[str, Any] = MappingProxyType({})
_SILENT = {"kind": "step", "start": "0", "end": "0", "t_step": "0"}


def columns_of_bench(
    inputs: Mapping[str, str], columns: Mapping[str, str], time: str, units: Mapping[str, str]
) -> NamedColumns:
    """Return the columns that are named for a bench's inputs and outputs.

    An input keeps the name that it was given; an output is called as the model calls it.

    Parameters
    ----------
    inputs, columns
        Column of each stimulus, and of each output whose column is named.
    time
        Column of the instants.
    units
        SI unit of every signal that matters, by name.

    Raises
    ------
    ParameterError
        When one name means two columns.
    """
    driving = {column: stimulus for stimulus, column in inputs.items()}
    for name, column in columns.items():
        if name in driving and column != name:
            raise ParameterError(
                f"{name} means two columns: {name} itself, which drives {driving[name]}, and "
                f"{column}; write the first one with its unit, as "
                f"{option('inputs', {driving[name]: f'{name}[UNIT]'})}"
            )
    return NamedColumns({**{c: c for c in driving}, **columns}, time, units, driving)


def units_of(model: Model, inputs: Mapping[str, str], outputs: Iterable[str]) -> dict[str, str]:
    """Return the SI units of the signals that a replay may need, by name."""
    stimuli, known = signals_of(model.Stimulus), signals_of(model.Output)
    units = {name: signal.unit for name, signal in {**known, **stimuli}.items()}
    wanted = {**dict.fromkeys(outputs or known), **dict.fromkeys([] if inputs else stimuli)}
    given = {column: stimuli[name].unit for name, column in inputs.items() if name in stimuli}
    return {name: units[name] for name in wanted if name in units} | given


def driven_bench(bench: Bench | str | Path, changes: Mapping[str, Any]) -> Bench:
    """Return a bench; one that wants a stimulus gets none of its own, for it is measured.

    Parameters
    ----------
    bench
        A `Bench`, the path of a bench file, or an experiment's name.
    changes
        As ``--set`` takes them.

    Raises
    ------
    InputError
        When it cannot be read, or something does not fit.
    """
    if isinstance(bench, Bench):
        return bench.with_overrides(changes) if changes else bench
    try:
        return bench_file.read(bench, changes)
    except ParameterError as error:
        if "[stimulus]" not in str(error):
            raise
    silent = {f"stimulus.{key}": value for key, value in _SILENT.items()}
    return bench_file.read(bench, {**silent, **changes})


def stretches_of(
    wanted: str | Path, inputs: xr.Dataset, limits: Mapping[str, str]
) -> list[Segment]:
    """Return the stretches that are judged: those of a file, what is found, or the whole record."""
    if not wanted:
        return whole_record(inputs["time"].values, limits)
    if wanted == "auto":
        return found_in(next(iter(inputs.data_vars.values())), limits)
    return read_segments(wanted, limits)
