"""Replay: a bench's model driven by measured demands, compared with the measured response."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from difflib import get_close_matches

import numpy as np
import xarray as xr

from bywire.bench.bench import Bench
from bywire.bench.energy_ledger import energy_signals
from bywire.bench.experiment import Case, changes_of, driven_at
from bywire.bench.recording import energy_doubts_of
from bywire.bench.step_error import MOST_WORK, NO_ESTIMATE, abandoned, steps_of, unestimated
from bywire.core.callers import option
from bywire.core.errors import (
    ParameterError,
    StepError,
    UnitError,
    by_likeness,
    counted,
    nearest_first,
    unknown_name,
    unknown_of_few,
)
from bywire.core.parameters import leaf_fields
from bywire.core.quantities import display_unit
from bywire.core.signals import Signal, signals_of, without_noise
from bywire.core.typing import Array
from bywire.core.units import shown
from bywire.data.column_units import measures, unit_of_symbol
from bywire.identification.measured import RECORD, as_even, require_signals
from bywire.identification.output_error import Between, even_interval
from bywire.simulation.run import Run, Trajectory, simulate

_UNLIKE = (
    ", but no measured signal has its unit. If a column measures it in another unit, such as a "
    "sensor's voltage, set its scale and unit with {}. "
)
_SHOWN = 3  # other signals of the same quantity in an error
_ACCUMULATED = ("J", "s")  # accumulated quantities, whose errors do not show the quality of fit


def _compared_outputs(
    case: Case, data: xr.Dataset, wanted: Sequence[str] | None, driven: Mapping[str, str]
) -> tuple[list[str], tuple[str, ...]]:
    """Return the compared outputs, with notes.

    Parameters
    ----------
    case, data
        Run of the model, and measured signals.
    wanted
        Outputs; default: all measured ones that show the quality of fit.
    driven
        Stimulus -> measured signal; these are not compared by default.

    Raises
    ------
    UnknownNameError, UnitError, ParameterError
        When an output is not in the model or not measured, or nothing can be compared.
    """
    signals, there = signals_of(case.model.Output), [str(name) for name in data.data_vars]
    notes: tuple[str, ...] = ()
    if wanted is None:
        known = [n for n in there if n in signals and n not in driven.values()]
        wanted = [n for n in known if _tells(data[n].values, signals[n].unit)] or known
        passed = [n for n in known if n not in wanted]
        if passed:
            notes = (f"not compared (flags, sums or constants): {', '.join(passed)}",)
    if not wanted:
        free = [name for name in there if name not in driven.values()]
        pairs = _pairs(data, free, signals)
        raise ParameterError(
            "no measured signal has the name of an output of the model. "
            f"{_advice('outputs', pairs)}"
            f"The measured signals are {_measured_first(data, signals)}. "
            f"'bywire list {case.model.name}' lists all outputs",
            name="outputs",
            valid=", ".join(signals),
        )
    for name in wanted:
        if name not in signals:
            alike = [model for model, _ in _pairs(data, [name], signals)] if name in data else []
            raise unknown_name("output", name, signals, alike, f"bywire list {case.model.name}")
        _require_measured(data, name, signals[name])
    return list(wanted), notes


def _pairs(
    data: xr.Dataset, measured: Sequence[str], signals: Mapping[str, Signal]
) -> list[tuple[str, str]]:
    """Return signals of the model with measured ones of the same quantity, the likeliest first.

    Without a similar name, such as for a title in another language, the order is the model's.
    """
    pairs = []
    for name in measured:
        unit = unit_of_symbol(str(data[name].attrs.get("units", "1")))
        alike = [model for model, signal in signals.items() if measures(unit, signal.unit)]
        likely = by_likeness(alike, [name])
        if likely and not get_close_matches(name.casefold(), [likely[0].casefold()]):
            likely = alike
        pairs += [(model, name) for model in likely]
    return pairs


def _advice(argument: str, pairs: Sequence[tuple[str, str]]) -> str:
    """Return what to type to assign measured signals; empty if none fits."""
    fitting: dict[str, list[str]] = {}
    for model, column in pairs:
        fitting.setdefault(column, []).append(model)
    if not fitting:
        return ""
    typed: dict[str, str] = {}
    for column, models in fitting.items():
        typed.setdefault(models[0], column)
    others = "".join(
        f". {column} may also be {', '.join(models[1:][: _SHOWN + 1])}"
        for column, models in fitting.items()
        if len(models) > 1 and column in list(typed.values())[:_SHOWN]
    )
    rest = [column for column, models in fitting.items() if typed[models[0]] != column]
    if rest:
        others += f". {', '.join(rest[:_SHOWN])} would also fit"
    return f"For example, type {option(argument, dict(list(typed.items())[:_SHOWN]))}{others}. "


def _measured_first(data: xr.Dataset, signals: Iterable[str]) -> str:
    """Return the measured signals with their units, those with similar names first."""
    units = {str(n): display_unit(str(a.attrs.get("units", "1"))) for n, a in data.items()}
    return nearest_first(units, signals, units)


def _tells(values: Array, unit: str) -> bool:
    """Return whether a signal varies and is neither a flag nor accumulated."""
    there = values[np.isfinite(values)]
    if unit in _ACCUMULATED or not there.size or np.ptp(there) == 0.0:
        return False
    return not (unit == "1" and bool(np.all(there == np.round(there))))


def _missed_samples(data: xr.Dataset, compared: Sequence[str]) -> list[str]:
    """Return a sentence for each compared signal that misses samples."""
    counts = {name: int(np.isnan(data[name].values).sum()) for name in compared}
    total = data.sizes["time"]
    return [
        f"{name} is missing {count} of {total} samples ({100.0 * count / total:.2g} %), which "
        "bywire "
        "does not compare"
        for name, count in counts.items()
        if count
    ]


def _require_measured(data: xr.Dataset, name: str, signal: Signal) -> None:
    """Reject a signal that is not measured, or whose unit has another dimension."""
    require_signals(data, [name])
    unit = str(data[name].attrs.get("units", "1"))
    if unit != signal.unit and not measures(unit_of_symbol(unit), signal.unit):
        raise UnitError(
            f"{name} is in {unit}, but must be in {signal.unit}. Choose another column. "
            "If this column contains a scaled value, set its scale and unit with "
            f"{option('mapping')}",
            name=name,
            value=unit,
            valid=signal.unit,
        )


# --- The run, before it is computed
# This works for any assembly and experiment. A run of the experiment defines model, parameters,
# start and unmeasured stimuli; measured signals replace their stimuli. Sensor noise is off.


@dataclass(frozen=True)
class MeasuredRun:
    """A run with its measured inputs and outputs.

    Parameters
    ----------
    bench
        Bench with the measured start.
    case
        Its run, aligned to the record.
    data
        Measured signals over ``time`` [s], at the times at which the model is recorded.
    driven
        Stimulus -> measured signal.
    compared
        Outputs, measured under the same names.
    run
        Run to compute; its first ``settled`` rows are before the record.
    settled
        Number of rows in the settling time.
    begun_at
        Option of the experiment -> signal whose first sample sets it.
    notes
        Notes for the user.
    """

    bench: Bench
    case: Case
    data: xr.Dataset
    driven: Mapping[str, str]
    compared: tuple[str, ...]
    run: Run
    settled: int
    begun_at: Mapping[str, str]
    notes: tuple[str, ...]


def measured_run(
    bench: Bench,
    data: xr.Dataset,
    inputs: Mapping[str, str] | None = None,
    outputs: Sequence[str] | None = None,
    case: str = "",
    *,
    settle: bool = True,
    between: Between = "held",
) -> MeasuredRun:
    """Return a bench's run over measured demands.

    Parameters
    ----------
    bench
        Its experiment defines model, start, and unmeasured stimuli.
    data
        Measured signals over ``time`` [s], SI; resampled if the model's steps require it. The
        run starts with the record; if its time is negative, it includes part of the settling.
    inputs
        Stimulus of the model -> measured signal; default: all of the same name.
    outputs
        Outputs of the model, measured under the same names; default: all except flags,
        accumulated signals (energies, times) and constant ones.
    case
        Label of the experiment's run; the first one by default.
    settle
        Whether the run settles before the record, as in the experiment.
    between
        Inputs between samples: a controller's demands are held. Interpolate smooth inputs linearly
        if the model reads them faster than they were measured.

    Raises
    ------
    UnknownNameError
        When a signal is not measured, or the model has no signal of that name.
    ParameterError
        When no signal drives the model, none is compared, or an input has gaps.
    """
    chosen = case_of(bench, case)
    driven = _inputs(chosen, data, inputs)
    left = [name for name in driven_at(chosen, np.zeros(1)) if name not in driven]
    kept = [f"no measured signal replaces the experiment's {name}" for name in left]
    compared, passed = _compared_outputs(chosen, data, outputs, driven)
    bench, begun_at, notes = _started(bench, data, compared)
    chosen = case_of(bench, case)
    if not settle and chosen.settle > 0.0:
        chosen = replace(chosen, settle=0.0)
        notes = (*notes, "the run starts with the record, without the experiment's settling time")
    data, chosen, said = _on_grid(bench, data, chosen)
    for signal in driven.values():
        missing = np.flatnonzero(np.isnan(data[signal].values))
        if missing.size:
            at = float(data["time"].values[missing[0]])
            raise ParameterError(
                f"{signal} drives the model, but is missing {counted(missing.size, 'sample')}, "
                f"the first at {at:.4g} s. Trim the record there, or fill the gap by "
                "interpolation with 'bywire convert IN OUT --rate RATE --exclude nothing', and "
                "use the converted file",
                name=signal,
            )
    run = _run(bench, chosen, data, driven, between)
    return MeasuredRun(
        bench,
        chosen,
        data,
        driven,
        tuple(compared),
        run,
        round(chosen.settle / run.record),
        begun_at,
        (*kept, *notes, *said, *passed),
    )


def case_of(bench: Bench, label: str) -> Case:
    """Return a run of a bench's experiment; the first one if the label is empty.

    Raises
    ------
    UnknownNameError
        For an unknown label.
    ParameterError
        When the experiment makes no run.
    """
    cases = {case.label: case for case in bench.cases()}
    if not cases:
        raise ParameterError(
            f"experiment {bench.experiment!r} has no run to replay. Choose another experiment",
            name="experiment",
            value=bench.experiment,
        )
    if label and label not in cases:
        raise unknown_name(f"run of {bench.experiment}", label, cases)
    return cases[label] if label else next(iter(cases.values()))


def _inputs(case: Case, data: xr.Dataset, wanted: Mapping[str, str] | None) -> dict[str, str]:
    stimuli, there = signals_of(case.model.Stimulus), [str(name) for name in data.data_vars]
    if wanted is None:
        wanted = {name: name for name in there if name in stimuli}
    driven = without_noise(stimuli)
    if not wanted:
        its_own = [name for name in driven_at(case, np.zeros(1)) if name in driven]
        pairs = _pairs(data, there, {name: stimuli[name] for name in its_own or driven})
        units = {name: display_unit(stimuli[name].unit) for name in driven}
        drives = ", ".join(f"{name} [{units[name]}]" for name in its_own or driven)
        raise ParameterError(
            f"no measured signal drives the model. The experiment drives {drives}"
            f"{'. ' if pairs else _UNLIKE.format(option('mapping'))}"
            f"{_advice('inputs', pairs)}The measured signals are {_measured_first(data, driven)}. "
            f"All inputs of the model are {', '.join(driven)}",
            name="inputs",
            valid=", ".join(driven),
        )
    for stimulus, signal in wanted.items():
        if stimulus not in stimuli:
            raise unknown_of_few("stimulus", stimulus, driven)
        _require_measured(data, signal, stimuli[stimulus])
    return dict(wanted)


def _started(
    bench: Bench, data: xr.Dataset, compared: Sequence[str]
) -> tuple[Bench, dict[str, str], tuple[str, ...]]:
    """Return the bench with the measured start, if the experiment has one."""
    for name, signal in bench.definition.begins_at.items():
        known = name in bench.chosen_options.flat() and name not in bench.options
        if known and signal in compared:
            first = data[signal].values[np.isfinite(data[signal].values)][:1]
            leaf = leaf_fields(bench.definition.options)[name]
            start = max(float(first[0]), leaf.low) if first.size else leaf.low
            started = replace(bench, options={**bench.options, name: start})
            note = f"the run starts at the measured {signal}, {start:.5g} {leaf.unit.symbol}"
            return started, {name: signal}, (note,)
    return bench, {}, ()


def _on_grid(
    bench: Bench, data: xr.Dataset, case: Case
) -> tuple[xr.Dataset, Case, tuple[str, ...]]:
    """Return data at the model's recording times, and the case aligned to them."""
    interval = even_interval(data["time"].values)
    # A clock that starts below zero belongs to the experiment: part of its settling was recorded.
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
        f"the step of {shown(bench.step, 's')} divides neither the measurement's interval of "
        f"{shown(interval, 's')} nor the recording interval of {shown(case.record, 's')}. "
        "Resample the measurement "
        "('bywire convert --rate')",
        name="step",
        value=shown(bench.step, "s"),
    )


def _run(
    bench: Bench, case: Case, data: xr.Dataset, driven: Mapping[str, str], between: Between
) -> Run:
    interval = case.record
    columns = {name: data[signal].values for name, signal in driven.items()}
    fields = case.model.Stimulus._fields
    begin = min(float(data["time"].values[0]), 0.0)

    def stimulus(t: Array) -> Array:
        """Return measured values between samples; the first one during settling."""
        rows = np.zeros((t.size, len(fields)))
        given = driven_at(case, t - case.settle + begin)
        at = (t - case.settle) / interval
        at = np.floor(at + 1e-6) if between == "held" else at
        for k, name in enumerate(fields):
            if name in columns:
                rows[:, k] = np.interp(at, np.arange(columns[name].size), columns[name])
            elif name in given and not name.startswith("noise_"):
                rows[:, k] = given[name]
        return rows

    duration = case.settle + (data.sizes["time"] - 1) * interval
    return Run(
        case.model,
        case.par,
        case.state,
        case.memory,
        stimulus,
        duration,
        bench.step,
        interval,
        changes_of(case, case.settle - begin),
    )


# --- Comparison with the measured response


@dataclass(frozen=True)
class Replayed:
    """A measurement and its replay.

    Parameters
    ----------
    inputs
        Inputs of the model over ``time`` [s], by stimulus signal.
    outputs
        ``measured`` and ``modeled`` over ``time`` [s], by output signal.
    run
        The run of the model.
    notes
        Notes for the user.
    others
        ``outputs`` at other steps, by step length relative to the run's; empty unless requested.
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
        See `measured_run`.
    estimate_error
        Whether the model also runs at other steps; see `bywire.bench.running.run`.

    Raises
    ------
    UnknownNameError
        When a signal is not measured, or the model has no signal of that name.
    ParameterError
        When no signal drives the model, none is compared, or an input has gaps.
    """
    if RECORD in data:
        raise ParameterError(
            "replay needs a single record, but this measurement has several", name="data"
        )
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
            *_missed_samples(measured.data, measured.compared),
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
        Measured signals.
    name
        The signal.
    modeled
        Modeled values at the same times, shape (n,).
    """
    attrs = {
        "units": data[name].attrs.get("units", "1"),
        "long_name": data[name].attrs.get("long_name", name),
    }
    return xr.Dataset(
        {"measured": ("time", data[name].values, attrs), "modeled": ("time", modeled, attrs)},
        {"time": data["time"]},
    )
