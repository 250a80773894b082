"""Measured demands drive a bench's model, and its answer is laid beside the measured one.

Any assembly and any experiment: the experiment's first run gives model, parameters, start and
what is not measured; measured signals take the place of the stimulus signals that they are given
for. Sensor noise stays off.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from bywire.bench.bench import Bench
from bywire.bench.experiment import Case
from bywire.core.errors import ParameterError, StepError, unknown_name
from bywire.core.signals import signals_of
from bywire.identification.measured import as_even
from bywire.identification.output_error import even_interval
from bywire.identification.records import RECORD
from bywire.identification.replaying.compared import (
    compared_outputs,
    missed_samples,
    require_measured,
)
from bywire.simulation.run import Run, simulate

Array = NDArray[np.float64]

_AT_START = {"p_start": "p_mc"}  # option of an experiment: output that shows it


@dataclass(frozen=True)
class Replayed:
    """A measurement beside its replay.

    Parameters
    ----------
    inputs
        What drove the model, over ``time`` [s], by stimulus signal.
    outputs
        ``measured`` and ``modeled`` over ``time`` [s], by output signal.
    run
        The run of the model.
    notes
        What the user should know.
    """

    inputs: xr.Dataset
    outputs: Mapping[str, xr.Dataset]
    run: Run
    notes: tuple[str, ...]


def replay(
    bench: Bench,
    data: xr.Dataset,
    inputs: Mapping[str, str] | None = None,
    outputs: Sequence[str] | None = None,
    case: str = "",
) -> Replayed:
    """Run a bench's model over measured demands.

    Parameters
    ----------
    bench
        Its experiment gives model, start, and what is not measured.
    data
        Measured signals over ``time`` [s], SI; resampled where the model's steps want it. The
        run begins with the record; a time that begins before zero is taken as the experiment's.
    inputs
        Stimulus of the model -> measured signal; by default all of the same name.
    outputs
        Outputs of the model, measured under the same names; by default all that are but flags,
        what accumulates (energies, times) and what does not move.
    case
        Label of the experiment's run; the first one by default.

    Raises
    ------
    UnknownNameError
        When a signal is not measured, or the model has none of that name.
    ParameterError
        When nothing drives the model, nothing is compared, or an input has gaps.
    """
    if RECORD in data:
        raise ParameterError("replay takes one record, and this measurement has several")
    chosen = _case(bench, case)
    driven = _inputs(chosen, data, inputs)
    compared, passed = compared_outputs(chosen, data, outputs, driven)
    bench, notes = _started(bench, data, compared)
    chosen = _case(bench, case)
    data, chosen, said = _on_grid(bench, data, chosen)
    for signal in driven.values():
        missing = np.flatnonzero(np.isnan(data[signal].values))
        if missing.size:
            at = float(data["time"].values[missing[0]])
            raise ParameterError(
                f"{signal} drives the model and misses {missing.size} samples, the first at "
                f"{at:.4g} s: cut the record there"
            )
    run = _run(bench, chosen, data, driven)
    rows = round(chosen.settle / run.record)
    modeled = simulate(run, tuple(compared))
    return Replayed(
        _driving(chosen, data, driven),
        {name: _beside(data, name, modeled[name][rows:]) for name in compared},
        run, (*notes, *said, *missed_samples(data, compared), *passed),
    )  # fmt: skip


def _case(bench: Bench, label: str) -> Case:
    found = {one.label: one for one in bench.cases()}
    if not found:
        raise ParameterError(f"experiment {bench.experiment!r} makes no run: replay another one")
    if label and label not in found:
        raise unknown_name(f"run of {bench.experiment}", label, found)
    return found[label] if label else next(iter(found.values()))


def _inputs(case: Case, data: xr.Dataset, wanted: Mapping[str, str] | None) -> dict[str, str]:
    stimuli, there = signals_of(case.model.Stimulus), [str(name) for name in data.data_vars]
    if wanted is None:
        wanted = {name: name for name in there if name in stimuli}
    if not wanted:
        raise ParameterError(
            f"nothing measured drives the model: give --input STIMULUS=SIGNAL with one of "
            f"{', '.join(n for n in stimuli if not n.startswith('noise_'))} "
            f"and one of {', '.join(there)}"
        )
    for stimulus, signal in wanted.items():
        if stimulus not in stimuli:
            raise unknown_name("stimulus", stimulus, stimuli)
        require_measured(data, signal, stimuli[stimulus])
    return dict(wanted)


def _started(
    bench: Bench, data: xr.Dataset, compared: Sequence[str]
) -> tuple[Bench, tuple[str, ...]]:
    """Return the bench with its start at what was measured, where the experiment has one."""
    for option, signal in _AT_START.items():
        known = option in bench.chosen_options.flat() and option not in bench.options
        if known and signal in compared:
            first = data[signal].values[np.isfinite(data[signal].values)][:1]
            start = max(float(first[0]), 0.0) if first.size else 0.0
            own = replace(bench, options={**bench.options, option: start})
            return own, (f"starts at the measured {signal}, {start:.5g} Pa",)
    return bench, ()


def _on_grid(
    bench: Bench, data: xr.Dataset, case: Case
) -> tuple[xr.Dataset, Case, tuple[str, ...]]:
    """Return data on instants at which the model can be recorded, and the case aligned to them."""
    interval = even_interval(data["time"].values)
    # A clock that begins before zero is the experiment's own: part of its settling was recorded.
    case = replace(case, settle=max(case.settle + min(float(data["time"].values[0]), 0.0), 0.0))
    try:
        return data, case.aligned(bench.step, interval), ()
    except StepError:
        near = max(round(interval / bench.step), 1) * bench.step
    for candidate in (near, case.record):
        try:
            aligned = case.aligned(bench.step, float(f"{candidate:.9g}"))
        except StepError:
            continue
        even, said = as_even(data, aligned.record)
        return even, aligned, tuple(said)
    raise StepError(
        f"neither samples every {interval:g} s nor every {case.record:g} s go with steps of "
        f"{bench.step:g} s: resample the measurement (bywire convert --rate)"
    )


def _run(bench: Bench, case: Case, data: xr.Dataset, driven: Mapping[str, str]) -> Run:
    interval = case.record
    columns = {name: data[signal].values for name, signal in driven.items()}
    fields = case.model.Stimulus._fields
    begin = min(float(data["time"].values[0]), 0.0)

    def stimulus(t: Array) -> Array:
        """Measured values held from one sample to the next; the first one while it settles."""
        rows = np.zeros((t.size, len(fields)))
        given = case.stimulus(t - case.settle + begin)
        index = np.floor((t - case.settle) / interval + 1e-6).astype(int)
        for k, name in enumerate(fields):
            if name in columns:
                rows[:, k] = columns[name][np.clip(index, 0, columns[name].size - 1)]
            elif name in given and not name.startswith("noise_"):
                rows[:, k] = given[name]
        return rows

    duration = case.settle + (data.sizes["time"] - 1) * interval
    return Run(
        case.model, case.par, case.state, case.memory, stimulus, duration, bench.step, interval
    )


def _driving(case: Case, data: xr.Dataset, driven: Mapping[str, str]) -> xr.Dataset:
    signals = signals_of(case.model.Stimulus)
    return xr.Dataset(
        {
            name: ("time", data[signal].values,
                   {"units": signals[name].unit, "long_name": signals[name].label})
            for name, signal in driven.items()
        },
        {"time": data["time"]},
    )  # fmt: skip


def _beside(data: xr.Dataset, name: str, modeled: Array) -> xr.Dataset:
    attrs = {
        "units": data[name].attrs.get("units", "1"),
        "long_name": data[name].attrs.get("long_name", name),
    }
    return xr.Dataset(
        {"measured": ("time", data[name].values, attrs), "modeled": ("time", modeled, attrs)},
        {"time": data["time"]},
    )
