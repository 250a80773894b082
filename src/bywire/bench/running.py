"""Run a bench: recordings, key figures and verdicts."""

from __future__ import annotations

import json
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from bywire.bench.bench import Bench
from bywire.bench.experiment import Case, as_run, check_extent, check_recordings
from bywire.bench.kpis.kpi import Kpi
from bywire.bench.recording import Recordings, Rows, rows_of, run_notes, watch, watched_rows
from bywire.bench.requirements import Verdict, judge, status_of
from bywire.bench.step_error import (
    MOST_WORK,
    NO_ESTIMATE,
    abandoned,
    note_step_errors,
    steps_of,
    unestimated,
    with_step_errors,
)
from bywire.bench.stimulus import Stimulus
from bywire.core.errors import ParameterError, unknown_name
from bywire.core.interrupts import interrupt_handled, interrupts_deferred
from bywire.core.signals import signals_of
from bywire.simulation.engine import prepare
from bywire.simulation.run import Run, Trajectory, simulate

if TYPE_CHECKING:
    import xarray as xr


@dataclass(frozen=True)
class Result:
    """Result of a bench: recordings, key figures and verdicts.

    Parameters
    ----------
    recordings
        One dataset per run of the experiment, by label.
    status
        ``done`` (no requirements), ``passed``, ``failed`` (a requirement was not met),
        ``undecided`` (a figure is within its numerical error of its limit) or ``interrupted``.
    unestimated
        Reason why a requested error estimate is missing; empty if it is not missing.
    """

    bench: Bench
    recordings: Mapping[str, xr.Dataset]
    kpis: tuple[Kpi, ...]
    verdicts: tuple[Verdict, ...]
    status: str
    unestimated: str = ""

    @property
    def recorded(self) -> Mapping[str, xr.Dataset]:
        """The recordings as `Rows`, which load faster than datasets, if they were not read yet."""
        made = self.recordings
        return made.rows if isinstance(made, Recordings) else made

    @property
    def recording(self) -> xr.Dataset:
        """The recording of an experiment that makes one run."""
        if len(self.recordings) != 1:
            labels = ", ".join(self.recordings)
            raise ParameterError(
                f"this experiment made several recordings. Choose one of them: {labels}",
                name="recording",
                valid=labels,
            )
        return next(iter(self.recordings.values()))

    def kpi(self, name: str) -> Kpi:
        """Return one KPI by name.

        Raises
        ------
        UnknownNameError
            With the nearest known names.
        """
        by_name = {kpi.name: kpi for kpi in self.kpis}
        if name not in by_name:
            raise unknown_name("KPI", name, by_name)
        return by_name[name]

    @property
    def warnings(self) -> list[str]:
        """Warnings of all runs."""
        warnings = [
            f"{label}: {text}" if len(self.recordings) > 1 else text
            for label, recording in self.recorded.items()
            for text in np.atleast_1d(recording.attrs.get("warnings", [])).tolist()
            if text  # a brake may write one text instead of a list
        ]
        return warnings + ([self.unestimated] if self.unestimated else [])


# --- Runs

Progress = Callable[[str, float], None]


def run(
    bench: Bench,
    progress: Progress | None = None,
    engine: str = "auto",
    estimate_error: bool = False,
) -> Result:
    """Run all cases of a bench, and judge them.

    Parameters
    ----------
    bench
        Bench to run; `bywire.load` reads a bench file.
    progress
        Called with the run's label and its completed fraction, 0 to 1.
    engine
        As in `Bench`; ``auto`` uses the bench's engine.
    estimate_error
        Whether to repeat all runs with half the step, a slightly shorter step, and double the step
        if that divides the sample times. Key figures and recorded signals then have an estimate of
        their numerical error. A figure whose distance to a limit is less than its error is
        undecided. The repeated runs need 3.6 times as many substeps as the run. Steps with which a
        run fails are left out. The result has a warning if no step remains, or if a run requires
        five times the work of the original run.

    Raises
    ------
    InputError
        When the runs cannot be set up.
    RunError
        When a run fails.
    """
    recordings: dict[str, xr.Dataset] = {}
    others: dict[float, dict[str, xr.Dataset]] = {}
    failures: dict[float, Exception] = {}
    is_complete = False
    work: dict[str, float] = {}
    try:
        _make_runs(bench, recordings, progress, engine, work)
        is_complete = True
        for factor in steps_of(bench.runs().values()) if estimate_error else ():
            try:
                other = replace(bench, step=factor * bench.step)
                made: dict[str, xr.Dataset] = {}
                held = _bytes_of(recordings, *others.values())
                remark = f", {factor:g} of the step"
                _make_runs(other, made, progress, engine, {}, remark, work, held)
                others[factor] = made
            except NO_ESTIMATE as error:
                failures[factor] = error
    except KeyboardInterrupt:  # outside the engine, which handles interrupts itself
        interrupt_handled()
        kpis = judged(bench, recordings).kpis if is_complete else ()
        return Result(bench, Recordings(recordings), kpis, (), "interrupted")
    result = judged(bench, recordings, others)
    note = abandoned(failures) if others else unestimated(failures)
    return replace(result, unestimated=note) if failures and note else result


def _make_runs(
    bench: Bench,
    recordings: dict[str, xr.Dataset],
    progress: Progress | None,
    engine: str,
    work: dict[str, float],
    remark: str = "",
    compared: Mapping[str, float] | None = None,
    held: float = 0.0,
) -> None:
    """Add all recordings of a bench, each as soon as it is complete, and the work of its runs.

    ``compared``: work of the runs with the bench's own step, which limits the work of these runs;
    ``held``: bytes of the recordings that are already in memory.
    """
    engine = bench.engine if engine == "auto" else engine
    recordings |= static_recordings(bench)
    runs = [(case, run_of(bench, case, k)) for k, case in enumerate(bench.cases())]
    check_recordings([computed for _, computed in runs], held)
    for case, computed in runs:
        if compared is not None:
            computed = replace(computed, most_work=MOST_WORK * compared[case.label])
        report = None if progress is None else partial(progress, case.label + remark)
        with interrupts_deferred():
            prepare(computed.model, computed.par).engine(engine)
        trajectory = simulate(computed, engine=engine, progress=report)
        is_complete = trajectory.status != "interrupted"
        work[case.label] = trajectory.work
        begins = case.settle - case.keep
        if is_complete or np.count_nonzero(trajectory.time >= begins - 1e-9) > 1:
            recordings[case.label] = recording_of(bench, case, computed, trajectory)
        if not is_complete:
            raise KeyboardInterrupt


def _bytes_of(*made: Mapping[str, xr.Dataset]) -> float:
    return float(sum(each.nbytes for recordings in made for each in recordings.values()))


def static_recordings(bench: Bench) -> dict[str, xr.Dataset]:
    """Return the recordings of an experiment without runs, by label."""
    static = bench.definition.static
    if static is None:
        return {}
    notes = {"parameters": bench.par.model_dump_json(), **_bench_notes(bench)}
    computed = static(bench.par, bench.chosen_options)
    return {label: each.assign_attrs(notes) for label, each in computed.items()}


def run_of(bench: Bench, case: Case, number: int) -> Run:
    """Return the engine's description of one of a bench's cases.

    Raises
    ------
    StepError
        When the run records nothing, or more than fits into this machine's memory.
    """
    computed = as_run(case, bench.step, seed=(bench.seed, number))
    check_extent(case, computed)
    return computed


def recording_of(bench: Bench, case: Case, computed: Run, trajectory: Trajectory) -> xr.Dataset:
    """Return the recording of a case as `Rows`, with the signals that its experiment adds."""
    notes = _case_notes(bench, case)
    rows = watched_rows(computed, trajectory, case.settle, case.keep, notes)
    return _finished(bench, case, cast("xr.Dataset", rows))


def _finished(bench: Bench, case: Case, recording: xr.Dataset) -> xr.Dataset:
    """Return a recording with the signals that its experiment adds."""
    definition = bench.definition
    if definition.beside is not None:
        recording = _with_inputs(recording, case)
    if bench.faults:
        recording = _with_faults(recording, bench)
    finish = definition.finish
    return recording if finish is None else finish(recording, bench.chosen_options)


def _with_faults(recording: xr.Dataset, bench: Bench) -> xr.Dataset:
    """Return a recording with the number of active faults."""
    time = recording["time"].values
    there = sum((fault.course.is_there(time) for fault in bench.injections), np.zeros(time.size))
    attributes = {"units": "1", "long_name": "number of active faults"}
    return recording.assign({"faults": ("time", there, attributes)})


def _case_notes(bench: Bench, case: Case) -> dict[str, Any]:
    return {**_bench_notes(bench), "case": case.label, "seed": bench.seed}


def rows_recorded(
    bench: Bench, case: Case, computed: Run, trajectory: Trajectory
) -> tuple[xr.Dataset, list[str]]:
    """Return the content of `recording_of` as plain arrays, and the warnings of the run."""
    rows = rows_of(computed, trajectory, case.settle, case.keep, partial(_case_notes, bench, case))
    recording = cast("xr.Dataset", rows)  # it has the same interface
    warnings = watch(recording, computed, trajectory)
    return _finished(bench, case, recording), warnings


def rows_of_case(
    bench: Bench, case: Case, rows: Rows, group: Sequence[Trajectory], k: int
) -> xr.Dataset:
    """Return the content of `recording_of` for one of several runs, from the rows of all."""

    def notes() -> dict[str, Any]:
        return {**run_notes(group[k].run, group[k]), **_case_notes(bench, case)}

    return _finished(bench, case, cast("xr.Dataset", rows.case(k, notes, group[k].run.par)))


def judged(
    bench: Bench,
    recordings: Mapping[str, xr.Dataset],
    others: Mapping[float, Mapping[str, xr.Dataset]] = MappingProxyType({}),
) -> Result:
    """Return the result of recordings: key figures, and verdicts on the requirements.

    Parameters
    ----------
    others
        The same runs with other steps, by the ratio of their step to the bench's. Figures and
        signals then have a numerical error.
    """

    def figures(made: Mapping[str, xr.Dataset]) -> tuple[Kpi, ...]:
        rows = {label: Rows.of(recording) for label, recording in made.items()}
        return bench.definition.judge(rows, bench.chosen_options)

    kpis = figures(recordings)
    if others:
        in_others = {factor: figures(made) for factor, made in others.items()}
        kpis = with_step_errors(kpis, in_others, recordings)
        note_step_errors(recordings, others)
    verdicts = judge(bench.limits.values(), kpis)
    return Result(bench, Recordings(recordings), kpis, verdicts, status_of(verdicts))


def _bench_notes(bench: Bench) -> dict[str, Any]:
    """Return the attributes of a recording that describe its bench."""
    return {
        "model": bench.system,
        "experiment": bench.experiment,
        "parameter_set": bench.parameters,
        "options": bench.chosen_options.model_dump_json(),
        "stimulus": json.dumps(_described(bench.chosen_stimuli)),
        **({"faults": json.dumps(bench.faults, default=str)} if bench.faults else {}),
        **({} if bench.error is None else {"stated_error": float(bench.error)}),
    }


def _with_inputs(recording: xr.Dataset, case: Case) -> xr.Dataset:
    """Return a recording with the stimuli that the model does not record."""
    time = recording["time"].values
    given = {name: y for name, y in case.stimulus(time).items() if name not in recording}
    attributes = _stimulus_attributes(case)
    return recording.assign({name: ("time", y, attributes[name]) for name, y in given.items()})


def inputs_recorded(rows: Rows, cases: Sequence[Case], wanted: Collection[str]) -> Rows:
    """Return the rows of several runs, and add requested stimuli that are missing."""
    each = [case.stimulus(rows["time"].values) for case in cases]
    lacking = [name for name in each[0] if name in wanted and name not in rows]
    given = {name: np.array([stimuli[name] for stimuli in each]) for name in lacking}
    return rows.with_signals(given, _stimulus_attributes(cases[0])) if given else rows


def _stimulus_attributes(case: Case) -> dict[str, dict[str, str]]:
    signals = signals_of(case.model.Stimulus)
    return {n: {"units": each.unit, "long_name": each.label} for n, each in signals.items()}


def _described(stimuli: Mapping[str, Stimulus]) -> dict[str, Any]:
    """Return stimuli as ``[stimulus]`` sections in SI; empty without stimuli."""
    sections = {
        name: {"kind": each.kind, **each.parameters.model_dump(mode="json")}
        for name, each in stimuli.items()
    }
    return {**sections.pop("", {}), **sections}
