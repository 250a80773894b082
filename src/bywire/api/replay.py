"""A measured demand drives a bench's model, and what it gives is laid beside the measurement."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any

import xarray as xr

from bywire.api.replay_answer import Replay
from bywire.bench import bench_file
from bywire.bench.bench import Bench
from bywire.core.errors import ParameterError
from bywire.core.model import Model
from bywire.core.signals import signals_of
from bywire.data.file_format import Progress, no_progress
from bywire.data.named_columns import NamedColumns
from bywire.identification.measured import measured, name_of
from bywire.identification.replaying import bench_replay, tracking
from bywire.identification.replaying.bench_replay import case_of
from bywire.identification.replaying.fit import judged
from bywire.identification.replaying.segments import (
    Segment,
    found_in,
    read_segments,
    whole_record,
)
from bywire.identification.replaying.tolerances import read_tolerances
from bywire.report.answer import use_case

_NONE: Mapping[str, Any] = MappingProxyType({})
_SILENT = {"kind": "step", "start": "0", "end": "0", "t_step": "0"}


@use_case
def replay(
    measurement: str | Path | xr.Dataset,
    bench: Bench | str | Path,
    overrides: Mapping[str, Any] = _NONE,
    *,
    mapping: str | Path | None = None,
    inputs: Mapping[str, str] = _NONE,
    outputs: Sequence[str] | Mapping[str, str] = (),
    time: str = "",
    case: str = "",
    tolerances: Sequence[str] = (),
    segments: str | Path = "",
    track: Sequence[str] = (),
    progress: Progress | None = None,
    estimate_error: bool = True,
) -> Replay:
    """Drive a bench's model with a measured demand, and compare.

    Parameters
    ----------
    measurement
        A file, or what `bywire.read_measurement` gives.
    bench, overrides
        A `Bench`, the path of a bench file, or an experiment's name; and what of it is changed,
        as ``--set`` takes it.
    mapping
        File that says what the columns of a measurement file mean.
    inputs
        Stimulus of the model -> measured signal, or column such as ``"Demand [bar]"``; by default
        all of the same name.
    outputs
        What is compared; by default all that are measured and tell how well the model fits. A
        mapping names their columns: ``{"p_mc": "Pressure [psi]"}``, empty for the same name.
    time
        Column of the instants, such as ``"Zeit [s]"``, or a sample rate; that of the file by
        default.
    case
        Run of the experiment; the first by default.
    tolerances
        Such as ``"nrmse <= 5 %"`` or ``"p_mc.max_error <= 2 bar"``.
    segments
        Stretches that are judged: ``"auto"`` for steps and holds, or a TOML file; by default the
        whole record.
    track
        Parameters that drift and are tracked, for instance ``"mu_B"``.
    progress
        Called with a label and the finished share, 0 to 1.
    estimate_error
        Whether the model runs in half and double steps too, for the error of the figures from the
        step. A tolerance that is closer than this error is undecided, neither met nor missed.

    Returns
    -------
    Replay
        Measurement and model by signal, in SI units, with the figures of their difference.

    Raises
    ------
    InputError
        When something that is asked for does not fit, or the measurement cannot be used.
    """
    shown = no_progress if progress is None else progress
    driven = driven_bench(bench, overrides)
    limits = read_tolerances(tolerances)
    columns = {n: c for n, c in outputs.items() if c} if isinstance(outputs, Mapping) else {}
    units = _units_of(case_of(driven, case).model, inputs, outputs)
    named = columns_of_bench(inputs, columns, time, units)
    read = measured([measurement], mapping, gaps=True, named=named, progress=shown)
    shown("replay", 0.0)
    replayed = bench_replay.replay(
        driven,
        read.data,
        inputs or None,
        list(outputs) or None,
        case,
        estimate_error=estimate_error,
    )
    shown("replay", 1.0)
    stretches = _segments(segments, replayed.inputs, limits)
    fits = judged(replayed.outputs, stretches, replayed.others)
    tracks = [tracking.track(name, read.data, replayed.run.par) for name in track]
    return Replay(driven, name_of(measurement), replayed, fits, tuple(tracks), tuple(read.notes))


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
                f"{column}; write the first one with its unit, as --input "
                f"{driving[name]}={name}[UNIT]"
            )
    return NamedColumns({**{c: c for c in driving}, **columns}, time, units, driving)


def _units_of(model: Model, inputs: Mapping[str, str], outputs: Iterable[str]) -> dict[str, str]:
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


def _segments(wanted: str | Path, inputs: xr.Dataset, limits: Mapping[str, str]) -> list[Segment]:
    if not wanted:
        return whole_record(inputs["time"].values, limits)
    if wanted == "auto":
        return found_in(next(iter(inputs.data_vars.values())), limits)
    return read_segments(wanted, limits)
