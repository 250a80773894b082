"""Measured demands drive a bench's model, and its answer is laid beside the measured one."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import xarray as xr

from bywire.bench.bench import Bench
from bywire.bench.recording import energy_doubts_of, energy_signals
from bywire.bench.step_error import MOST_WORK, NO_ESTIMATE, abandoned, steps_of, unestimated
from bywire.core.errors import ParameterError
from bywire.core.signals import signals_of
from bywire.core.typing import Array
from bywire.identification.records import RECORD
from bywire.identification.replaying.compared import missed_samples
from bywire.identification.replaying.measured_run import MeasuredRun, measured_run
from bywire.simulation.run import Run, Trajectory, simulate


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
    others
        ``outputs`` in other steps, by their length over that of the run; empty unless wanted.
    """

    inputs: xr.Dataset
    outputs: Mapping[str, xr.Dataset]
    run: Run
    notes: tuple[str, ...]
    others: Mapping[float, Mapping[str, xr.Dataset]] = field(default_factory=dict)


def replay(
    bench: Bench,
    data: xr.Dataset,
    inputs: Mapping[str, str] | None = None,
    outputs: Sequence[str] | None = None,
    case: str = "",
    *,
    estimate_error: bool = False,
) -> Replayed:
    """Run a bench's model over measured demands.

    Parameters
    ----------
    bench, data, inputs, outputs, case
        See ``bywire.identification.replaying.measured_run``.
    estimate_error
        Whether the model runs in other steps too; see `bywire.bench.running.run`.

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
    others: dict[float, Mapping[str, xr.Dataset]] = {}
    failures: dict[float, Exception] = {}
    for factor in steps_of([measured.run]) if estimate_error else ():
        try:
            step, most = factor * measured.run.step, MOST_WORK * modeled.work
            other = dataclasses.replace(measured.run, step=step, most_work=most)
            others[factor] = _beside_all(measured, simulate(other, tuple(measured.compared)))
        except NO_ESTIMATE as error:
            failures[factor] = error
    return Replayed(
        _driving(measured),
        _beside_all(measured, modeled),
        measured.run,
        (
            *measured.notes,
            *missed_samples(measured.data, measured.compared),
            *energy_doubts_of(measured.run, modeled),
            *filter(
                None, [unestimated(failures) if failures and not others else abandoned(failures)]
            ),
        ),
        others,
    )


def _beside_all(measured: MeasuredRun, modeled: Trajectory) -> dict[str, xr.Dataset]:
    return {
        name: beside(measured.data, name, modeled[name][measured.settled :])
        for name in measured.compared
    }


def _driving(measured: MeasuredRun) -> xr.Dataset:
    signals = signals_of(measured.case.model.Stimulus)
    return xr.Dataset(
        {
            name: (
                "time",
                measured.data[signal].values,
                {"units": signals[name].unit, "long_name": signals[name].label},
            )
            for name, signal in measured.driven.items()
        },
        {"time": measured.data["time"]},
    )


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
