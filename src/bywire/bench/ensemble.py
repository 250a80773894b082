"""Many benches of one experiment, run side by side if they differ only in numbers."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from typing import TYPE_CHECKING, Any, NamedTuple, cast, overload

import numpy as np
from numpy.typing import NDArray

from bywire.bench.bench import Bench
from bywire.bench.changes import OPTION, split_options
from bywire.bench.energy_ledger import are_surely_sound, energy_doubts_of_cases, energy_signals
from bywire.bench.experiment import Case, check_memory
from bywire.bench.joined import JoinedBenches, is_plain, one_of, options_of
from bywire.bench.kpis.families import FamilyJudge, of_cases
from bywire.bench.kpis.kpi import Kpi, KpiOfCases
from bywire.bench.recording import Rows, ends_of_group, rows_of_group, watch_cases
from bywire.bench.running import (
    Progress,
    Result,
    inputs_recorded,
    judged,
    recording_of,
    rows_of_case,
    rows_recorded,
    run_of,
    static_recordings,
)
from bywire.bench.step_error import MOST_WORK, NO_ESTIMATE, abandoned, steps_of, unestimated
from bywire.core.arguments import checked
from bywire.core.errors import InputError, ParameterError, unknown_name
from bywire.core.parameters import Leaf, ParameterSet, choice_fields, choices_of, leaf_fields
from bywire.core.typing import Array
from bywire.simulation import ensemble
from bywire.simulation.ensemble import Ensemble, RunGroup, Variations, fit_lanes, simulate_group
from bywire.simulation.run import Run, Trajectory, simulate
from bywire.simulation.run_table import change, parameters_of
from bywire.simulation.run_table import one_of as one_run

if TYPE_CHECKING:
    import xarray as xr


def varied_choices(bench: Bench) -> Mapping[str, tuple[Any, ...]]:
    """Return the possible values of every choice of a bench that may vary, by name.

    These are the structural choices of the brake, and those options ``options.NAME`` that have
    listed values or are true or false. Other texts name a signal or a file.
    """
    return choices_that_vary(type(bench.par), type(bench.chosen_options))


@lru_cache(maxsize=64)  # the same for all cases of a study
def choices_that_vary(
    of: type[ParameterSet], chosen: type[ParameterSet]
) -> Mapping[str, tuple[Any, ...]]:
    """Return `varied_choices` by the classes of a bench's parameters and options."""
    options = {f"{OPTION}{name}": choices_of(chosen, name) for name in choice_fields(chosen)}
    parameters = {name: choices_of(of, name) for name in choice_fields(of)}
    return parameters | {name: admitted for name, admitted in options.items() if admitted}


# --- The ensemble


@dataclass(frozen=True)
class BenchEnsemble:
    """Results of a bench for many values of its parameters and options.

    Parameters
    ----------
    variations
        Value [SI] in each case, shape (cases,), by the name of the parameter or ``options.NAME``.
    results
        Result of each case, judged by the bench's requirements.
    """

    variations: Mapping[str, Array]
    results: tuple[Result, ...]

    def kpi(self, name: str) -> Array:
        """Return a key figure of every case, shape (cases,); NaN where undefined."""
        return np.array([result.kpi(name).value for result in self.results])

    @property
    def met(self) -> NDArray[np.bool_]:
        """Whether each case meets all requirements, shape (cases,)."""
        return np.array([all(v.met for v in result.verdicts) for result in self.results])

    def __getitem__(self, signal: str) -> xr.DataArray:
        """Return a signal of an experiment that makes one run, dimensions case and time.

        Raises
        ------
        UnknownNameError
            When the signal is unknown.
        ParameterError
            When the experiment makes several runs: use ``results[k].recordings``.
        """
        each = [result.recording for result in self.results]
        if signal not in each[0]:
            raise unknown_name("signal", signal, map(str, each[0].data_vars))
        import xarray as xr  # slow to load

        joined = xr.concat([recording[signal] for recording in each], dim="case", join="outer")
        return joined.assign_coords({name: ("case", v) for name, v in self.variations.items()})


@overload
def simulate_ensemble(
    run: Run,
    variations: Variations,
    signals: Sequence[str],
    threads: int | None = None,
    engine: str = "auto",
) -> Ensemble: ...


@overload
def simulate_ensemble(
    run: Bench,
    variations: Variations,
    signals: None = None,
    threads: int | None = None,
    engine: str = "auto",
) -> BenchEnsemble: ...


@checked
def simulate_ensemble(
    run: Run | Bench,
    variations: Variations,
    signals: Sequence[str] | None = None,
    threads: int | None = None,
    engine: str = "auto",
) -> Ensemble | BenchEnsemble:
    """Compute one run, or a bench with all its runs, for many values of its parameters.

    Parameters
    ----------
    run
        A run: model, parameters, initial values, stimulus, steps; see
        `bywire.simulation.ensemble.simulate_ensemble`. Or a bench: every case then has the initial
        values that the experiment computes from its parameters, with key figures and verdicts.
    variations
        Values [SI] in each case, shape (cases,), by the dotted name of a parameter or by
        ``options.NAME`` of a bench. Other parameters keep their values.
    signals
        Outputs of a run to record. A bench records all signals that its key figures need.
    threads
        Number of threads, >= 1 (default: all cores).
    engine
        ``auto`` (the bench's engine, or lanes on this machine's processor), ``compiled``,
        ``virtual-machine``, or ``cuda`` (a graphics processor, see ``docs/studies.md``).

    Returns
    -------
    Ensemble
        For a run: its signals, shape (cases, rows) each.
    BenchEnsemble
        For a bench: recordings, key figures and verdicts of every case.

    Raises
    ------
    InputError
        For unknown names, values out of range, and variations of different lengths.
    RunError
        When a trajectory becomes infinite or not a number.
    """
    if isinstance(run, Run):
        if signals is None:
            raise ParameterError(
                "signals is missing. Specify the outputs of the run to record", name="signals"
            )
        return ensemble.simulate_ensemble(run, variations, signals, threads, engine)
    if signals is not None:
        raise ParameterError(
            "signals is not valid for a bench, which records all signals. Leave signals out",
            name="signals",
        )
    arrays = {name: np.atleast_1d(np.asarray(v, dtype=float)) for name, v in variations.items()}
    lengths = {name: array.size for name, array in arrays.items()}
    if not arrays or len(set(lengths.values())) != 1 or 0 in lengths.values():
        raise ParameterError(
            f"variations must all have the same length >= 1, got {lengths}",
            name="variations",
            value=str(lengths),
        )
    benches = [
        changed(run, {name: float(array[k]) for name, array in arrays.items()})
        for k in range(next(iter(lengths.values())))
    ]
    return BenchEnsemble(arrays, run_benches(benches, engine=engine, threads=threads))


def varied_leaf(bench: Bench, name: str) -> Leaf:
    """Return the description of a number of the parameters or options that may vary.

    Raises
    ------
    UnknownNameError
        With the most similar names in the bench.
    """
    return _varied_leaf(type(bench.par), type(bench.chosen_options), name)


def _varied_leaf(of: type[ParameterSet], chosen: type[ParameterSet], name: str) -> Leaf:
    parameters = leaf_fields(of)
    if name in parameters:
        return parameters[name]
    known = {f"{OPTION}{option}": leaf for option, leaf in leaf_fields(chosen).items()}
    if name not in known:
        raise unknown_name("parameter or option to vary", name, {**parameters, **known})
    return known[name]


class _Names(NamedTuple):
    """Names of changed parameters and options of a bench."""

    parameters: tuple[str, ...]
    options: tuple[tuple[str, str], ...]
    """each name with the name among the options"""
    switches: frozenset[str]
    """names of choices that are true or false"""


@lru_cache(maxsize=64)  # the same for all cases of a study
def _names_within(
    of: type[ParameterSet], chosen: type[ParameterSet], names: tuple[str, ...]
) -> _Names:
    """Sort names into parameters and options, or reject an unknown one."""
    choices = choices_that_vary(of, chosen)
    for name in names:
        if name not in choices:
            _varied_leaf(of, chosen, name)
    parameters, options = split_options({name: name for name in names})
    switches = frozenset(n for n in names if choices.get(n) == (False, True))
    return _Names(tuple(parameters), tuple((n, own) for own, n in options.items()), switches)


def changed(bench: Bench, values: Mapping[str, float | str], seed: int | None = None) -> Bench:
    """Return a bench with other parameters, choices and options [SI], and another seed.

    Switches are texts, ``"true"`` or ``"false"``, like other choices.

    Raises
    ------
    InputError
        When a name is unknown, or a value is out of range or contradicts another value. The message
        lists the values.
    """
    names = _names_within(type(bench.par), type(bench.chosen_options), tuple(values))
    plain: Mapping[str, Any] = values
    if names.switches:
        plain = {**values, **{name: values[name] in (True, "true") for name in names.switches}}
    overrides = {name: plain[name] for name in names.parameters}
    options = {within: plain[name] for name, within in names.options}
    try:
        return bench.varied(overrides, options, seed)
    except InputError as error:
        changes = ", ".join(
            f"{name} = {value}" if isinstance(value, str) else f"{name} = {value:g}"
            for name, value in values.items()
        )
        raise error.reworded(f"{changes} (in SI): {error}") from None


def run_benches(
    benches: Sequence[Bench],
    progress: Progress | None = None,
    engine: str = "auto",
    threads: int | None = None,
    estimate_error: bool = False,
) -> tuple[Result, ...]:
    """Make all runs of several benches of one experiment, and judge each bench.

    Cases that differ only in numbers (parameters, initial values, stimuli) run side by side in
    lanes. Other cases, and all cases without a compiler, run one after the other.

    Parameters
    ----------
    benches
        Benches of one experiment.
    progress
        Called with a run's label and the completed fraction, 0 to 1.
    engine
        ``auto``, ``compiled``, ``cuda``, or ``virtual-machine``, which has no lanes.
    threads
        Number of threads, >= 1 (default: all cores).
    estimate_error
        Whether to repeat all runs with other steps (see `bywire.bench.running.run`).

    Raises
    ------
    StepError
        When the runs together need too much memory, or steps do not divide each other.
    RunError
        When a run fails.
    KeyboardInterrupt
        When interrupted.
    """
    work: list[dict[str, float]] = [{} for _ in benches]
    recordings = _recordings(benches, progress, engine, threads, work)
    limits = [{label: MOST_WORK * each for label, each in done.items()} for done in work]
    others: list[dict[float, dict[str, xr.Dataset]]] = [{} for _ in benches]
    failures: list[dict[float, Exception]] = [{} for _ in benches]
    for factor in steps_of(benches[0].runs().values()) if estimate_error else ():
        with suppress(*NO_ESTIMATE):
            finer = [replace(bench, step=factor * bench.step) for bench in benches]
            computed = _recordings(finer, progress, engine, threads, limits=limits)
            for each, further in zip(others, computed, strict=True):
                each[factor] = further
            continue
        for bench, each, failed, most in zip(benches, others, failures, limits, strict=True):
            try:  # a single case may rule out a joint run
                other = replace(bench, step=factor * bench.step)
                (each[factor],) = _recordings([other], progress, engine, threads, limits=[most])
            except NO_ESTIMATE as error:
                failed[factor] = error
    results = map(judged, benches, recordings, others)
    notes = [
        abandoned(failed) if each else unestimated(failed) if failed else ""
        for each, failed in zip(others, failures, strict=True)
    ]
    return tuple(
        replace(result, unestimated=note) if note else result
        for result, note in zip(results, notes, strict=True)
    )


def _recordings(
    benches: Sequence[Bench],
    progress: Progress | None,
    engine: str,
    threads: int | None,
    work: Sequence[dict[str, float]] = (),
    limits: Sequence[Mapping[str, float]] = (),
) -> list[dict[str, xr.Dataset]]:
    """Return the recordings of each bench by label, and add the work of its runs."""
    recordings = [static_recordings(bench) for bench in benches]
    for made in rounds(benches, progress, engine, threads, limits=limits):
        given = zip(made.places, made.cases, made.runs, made.trajectories, strict=True)
        for k, case, run, trajectory in given:
            recordings[k][case.label] = recording_of(benches[k], case, run, trajectory)
            if work:
                work[k][case.label] = trajectory.work
    return recordings


# --- Runs side by side


@dataclass(frozen=True)
class Wanted:
    """Outputs to record of runs side by side.

    Parameters
    ----------
    signals
        Outputs in all rows.
    ends
        Outputs in only the first and last rows. Runs with changes, and graphics processors, record
        them in all rows.
    """

    signals: tuple[str, ...]
    ends: tuple[str, ...] = ()


@dataclass(frozen=True)
class Round:
    """One run of each of several benches.

    Parameters
    ----------
    places
        Indices of the benches that make this run.
    cases, runs, trajectories
        Case of each bench, its run for the engine, and the trajectory.
    """

    places: Sequence[int]
    cases: Sequence[Case]
    runs: Sequence[Run]
    trajectories: Sequence[Trajectory]


def rounds(
    benches: Sequence[Bench],
    progress: Progress | None = None,
    engine: str = "auto",
    threads: int | None = None,
    signals: Callable[[Run], Wanted | None] = lambda _: None,
    limits: Sequence[Mapping[str, float]] = (),
    hold: bool = False,
) -> Iterator[Round]:
    """Yield the first run of all benches, then the second run, and so on.

    Runs that fit into lanes form a `RunGroup`, which records only rows that a recording keeps.
    Other runs, and all runs without a compiler, are computed one after the other.

    Parameters
    ----------
    benches
        Benches of one experiment.
    progress, engine, threads
        As in `run_benches`.
    signals
        ``signals(run)``: outputs to record of runs side by side; None for all.
    limits
        Maximum work of each bench's runs, by label (default: unlimited).
    hold
        Whether a graphics processor may hold the rows of a round until the next one.

    Raises
    ------
    StepError
        When the runs together need too much memory.
    RunError
        When a run fails.
    KeyboardInterrupt
        When interrupted.
    """
    for places, cases, runs in _runs(benches, limits):
        one = one_run(runs)
        wanted = signals(one)
        outputs = one.model.Output._fields if wanted is None else wanted.signals
        ends = () if wanted is None else wanted.ends
        kinds = [engine] * len(places)
        if engine == "auto":
            joined = isinstance(benches, JoinedBenches)
            kinds = [one_of(benches).engine] if joined else [benches[k].engine for k in places]
        if ends and change(runs):
            both, ends = {*outputs, *ends}, ()
            outputs = tuple(name for name in one.model.Output._fields if name in both)
        check_memory(one, len(runs) * len(outputs))
        report = None if progress is None else partial(progress, cases[0].label)
        kept = {(case.settle, case.keep) for case in cases}
        computing = {"auto" if kind == "compiled" else kind for kind in kinds}
        is_alike = len(computing) == 1 and len(kept) == 1
        if is_alike and len(runs) > 1 and fit_lanes(runs, kinds[0]):
            times = one.schedule().record_times - cases[0].settle
            first = int(np.searchsorted(times, -cases[0].keep - 1e-9))
            group = simulate_group(runs, outputs, threads, report, first, kinds[0], ends, hold)
            try:
                yield Round(places, cases, runs, group)
            finally:
                group.close()
        else:
            yield Round(places, cases, runs, _one_by_one(runs, report, kinds))


def _runs(
    benches: Sequence[Bench], limits: Sequence[Mapping[str, float]]
) -> Iterator[tuple[Sequence[int], Sequence[Case], Sequence[Run]]]:
    """Yield the indices of the benches that make a run, their cases and runs; see `rounds`."""
    if isinstance(benches, JoinedBenches):
        places = range(len(benches))
        yield places, [benches.like.cases()[0]] * len(places), benches.runs
        return
    every = [bench.cases() for bench in benches]
    for number in range(max(len(each) for each in every)):
        places_there = [k for k, each in enumerate(every) if number < len(each)]
        cases = [every[k][number] for k in places_there]
        given = list(zip(places_there, cases, strict=True))
        runs = [run_of(benches[k], case, number) for k, case in given]
        if limits:
            runs = [
                replace(run, most_work=limits[k][case.label])
                for (k, case), run in zip(given, runs, strict=True)
            ]
        yield places_there, cases, runs


def _one_by_one(runs: Sequence[Run], report: Any, kinds: Sequence[str]) -> list[Trajectory]:
    computed = []
    for k, (run, engine) in enumerate(zip(runs, kinds, strict=True)):
        share = None if report is None else partial(_share, report, k, len(runs))
        trajectory = simulate(run, engine=engine, progress=share)
        if trajectory.status == "interrupted":
            raise KeyboardInterrupt
        computed.append(trajectory)
    return computed


def _share(report: Any, k: int, count: int, share: float) -> None:
    report((k + share) / count)


# --- Key figures and warnings without recordings


@dataclass(frozen=True)
class KeyFigures:
    """Key figures and warnings of benches of one experiment, without recordings.

    Parameters
    ----------
    figures
        Key figures, each for all benches.
    warnings
        Warnings of the runs of each bench.
    """

    figures: tuple[KpiOfCases, ...]
    warnings: tuple[tuple[str, ...], ...]

    def kpis(self, k: int) -> tuple[Kpi, ...]:
        """Return the key figures of one bench."""
        return tuple(figure.case(k) for figure in self.figures)


def key_figures_of(benches: Sequence[Bench], threads: int | None = None) -> KeyFigures:
    """Return the key figures of several benches of one experiment, equal to those of `run_benches`.

    Parameters
    ----------
    benches
        Benches of one experiment and the same choices.
    threads
        Number of threads, >= 1 (default: all cores).

    Raises
    ------
    StepError
        When the runs need too much memory.
    RunError
        When a run fails.
    KeyboardInterrupt
        When interrupted.
    """
    one, options = one_of(benches), options_of(benches)
    judge = one.definition.judge
    families = judge if isinstance(judge, FamilyJudge) and is_plain(one) else None
    recordings: list[dict[str, Any]] = (
        [static_recordings(bench) for bench in benches]
        if families is None
        else [{} for _ in options]
    )
    warnings: list[list[str]] = [[] for _ in options]
    wanted = set() if families is None else families.signals(options)
    signals = partial(needed, wanted) if families is not None else lambda _: None
    figures: tuple[KpiOfCases, ...] | None = None
    for made in rounds(benches, threads=threads, signals=signals, hold=families is not None):
        group = made.trajectories
        if not isinstance(group, RunGroup):
            _recorded(benches, made, recordings, warnings)
            continue
        rows = rows_of_group(group, made.cases[0].settle)
        texts = watch_cases(
            rows, group.runs, group.unsettled.tolist(), _books(made, group, rows, threads)
        )
        for k, case, each in zip(made.places, made.cases, texts, strict=True):
            if each:
                warnings[k] += _labeled(benches[k], case, each)
        if families is not None:
            if one.definition.beside is not None:
                rows = inputs_recorded(rows, made.cases, wanted)
            figures = families.of_cases(rows, options, parameters_of(group.runs))
            continue
        for j, (k, case) in enumerate(zip(made.places, made.cases, strict=True)):
            recordings[k][case.label] = rows_of_case(benches[k], case, rows, group, j)
    if figures is None:
        figures = tuple(of_cases(list(map(judge, recordings, options))))
    return KeyFigures(figures, tuple(map(tuple, warnings)))


def numbers_per_case(bench: Bench) -> int:
    """Return how many numbers the stimulus and the rows of a case of `key_figures_of` have.

    The stimulus counts twice, because a graphics processor receives a copy of it.
    """
    judge, run = bench.definition.judge, next(iter(bench.runs().values()), None)
    wanted: Wanted | None = None
    if run is None:
        return 1
    if isinstance(judge, FamilyJudge) and is_plain(bench):
        wanted = needed(judge.signals([bench.chosen_options]), run)
    schedule, every = run.schedule(), run.model.Output._fields
    signals = len(every if wanted is None else wanted.signals)
    return schedule.rows * signals + 2 * schedule.stimulus_rows * len(run.model.Stimulus._fields)


def needed(wanted: set[str], run: Run) -> Wanted | None:
    """Return the outputs that key figures, warnings and energy balances read; None for all."""
    watched, names = run.model.watched(run.par), run.model.Output._fields
    if watched is None:
        return None
    rows, booked = {*wanted, *watched}, set(energy_signals(run))
    return Wanted(
        tuple(name for name in names if name in rows),
        tuple(name for name in names if name in booked - rows),
    )


def _books(made: Round, group: RunGroup, rows: Rows, threads: int | None) -> list[list[str]]:
    """Return every run's warnings on impossible energies.

    For most runs, the two ends rule out such warnings. Otherwise, all rows are computed.
    """
    if group.end_names:
        if are_surely_sound(cast("xr.Dataset", ends_of_group(group)), made.runs):
            return [[] for _ in made.places]
        one = one_run(made.runs)
        every, first = energy_signals(one), one.schedule().rows
        group = simulate_group(made.runs, every, threads, first=first - group.time.size)
        rows = rows_of_group(group, made.cases[0].settle)
    return energy_doubts_of_cases(cast("xr.Dataset", rows), len(made.runs), made.runs)


def _recorded(
    benches: Sequence[Bench],
    made: Round,
    recordings: list[dict[str, Any]],
    warnings: list[list[str]],
) -> None:
    """Add the recordings and warnings of runs that were computed one after the other."""
    for k, case, run, trajectory in zip(
        made.places, made.cases, made.runs, made.trajectories, strict=True
    ):
        recordings[k][case.label], texts = rows_recorded(benches[k], case, run, trajectory)
        warnings[k] += _labeled(benches[k], case, texts)


def _labeled(bench: Bench, case: Case, texts: Sequence[str]) -> list[str]:
    """Return warnings, with the run's label if there are several runs."""
    return [f"{case.label}: {t}" for t in texts] if len(bench.cases()) > 1 else list(texts)
