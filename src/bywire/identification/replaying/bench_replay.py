"""Measured demands drive a bench's model, and its answer is laid beside the measured one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import xarray as xr

from bywire.bench.bench import Bench
from bywire.bench.recording import energy_signals, open_books_of
from bywire.core.errors import ParameterError
from bywire.core.signals import signals_of
from bywire.core.typing import Array
from bywire.identification.records import RECORD
from bywire.identification.replaying.compared import missed_samples
from bywire.identification.replaying.measured_run import MeasuredRun, measured_run
from bywire.simulation.run import Run, simulate


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
    bench, data, inputs, outputs, case
        See ``bywire.identification.replaying.measured_run``.

    Raises
    ------
    UnknownNameError
        When a signal is not measured, or the model has none of that name.
    ParameterError
        When nothing drives the model, nothing is compared, or an input has gaps.
    """
    if RECORD in data:
        raise ParameterError("replay takes one record, and this measurement has several")
    measured = measured_run(bench, data, inputs, outputs, case)
    wanted = dict.fromkeys((*measured.compared, *energy_signals(measured.run)))
    modeled = simulate(measured.run, tuple(wanted))
    return Replayed(
        _driving(measured),
        {name: beside(measured.data, name, modeled[name][measured.settled:])
         for name in measured.compared},
        measured.run,
        (*measured.notes, *missed_samples(measured.data, measured.compared),
         *open_books_of(measured.run, modeled)),
    )  # fmt: skip


def _driving(measured: MeasuredRun) -> xr.Dataset:
    signals = signals_of(measured.case.model.Stimulus)
    return xr.Dataset(
        {
            name: ("time", measured.data[signal].values,
                   {"units": signals[name].unit, "long_name": signals[name].label})
            for name, signal in measured.driven.items()
        },
        {"time": measured.data["time"]},
    )  # fmt: skip


def beside(data: xr.Dataset, name: str, modeled: Array) -> xr.Dataset:
    """Return ``measured`` and ``modeled`` of one signal over ``time`` [s].

    Parameters
    ----------
    data
        What was measured.
    name
        The signal.
    modeled
        On the same instants, shape (n,).
    """
    attrs = {
        "units": data[name].attrs.get("units", "1"),
        "long_name": data[name].attrs.get("long_name", name),
    }
    return xr.Dataset(
        {"measured": ("time", data[name].values, attrs), "modeled": ("time", modeled, attrs)},
        {"time": data["time"]},
    )
