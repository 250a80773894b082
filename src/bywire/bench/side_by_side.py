"""Runs of several benches, side by side where they differ in numbers alone; their key figures."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, cast

import numpy as np
import xarray as xr

from bywire.bench.bench import Bench
from bywire.bench.experiment import Case
from bywire.bench.extent import check_memory
from bywire.bench.kpis.cases import FamilyJudge, of_cases
from bywire.bench.kpis.kpi import Kpi, KpiOfCases
from bywire.bench.recording import (
    are_surely_sound,
    ends_of_group,
    energy_doubts_of_cases,
    energy_signals,
    rows_of_group,
    watch_cases,
)
from bywire.bench.rows import Rows
from bywire.bench.running import (
    Progress,
    inputs_recorded,
    rows_of_case,
    rows_recorded,
    run_of,
    static_recordings,
)
from bywire.simulation.engine import CUDA
from bywire.simulation.run import Run, Trajectory, simulate
from bywire.simulation.run_group import RunGroup, fit_lanes, simulate_group


@dataclass(frozen=True)
class Wanted:
    """Outputs to record of runs side by side.

    Parameters
    ----------
    signals
        In all rows.
    ends
        In the first and the last one alone; in all of runs with changes, and of a graphics
        processor.
    """

    signals: tuple[str, ...]
    ends: tuple[str, ...] = ()


@dataclass(frozen=True)
class Round:
    """One run of each of several benches.

    Parameters
    ----------
    places
        Which of the benches make this run.
    cases, runs, trajectories
        What each asks for, as the engine takes it, and what it gave.
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
) -> Iterator[Round]:
    """Yield the first run of all benches, the second one, and so on.

    Runs that fit into lanes are a `RunGroup`, of which the settling that no recording keeps is not
    recorded; others, and all without a compiler, are computed one after the other.

    Parameters
    ----------
    benches
        Benches of one experiment.
    progress, engine, threads
        As of `bywire.bench.ensemble.run_benches`.
    signals
        ``signals(run)``: outputs to record of runs side by side; None for all.
    limits
        Of each bench the work that its runs may take, by label; without end by default.

    Raises
    ------
    StepError
        When the runs do not fit into this machine together.
    RunError
        When a run fails.
    KeyboardInterrupt
        When interrupted.
    """
    every = [bench.cases() for bench in benches]
    for number in range(max(len(each) for each in every)):
        places = [k for k, each in enumerate(every) if number < len(each)]
        cases = [every[k][number] for k in places]
        runs = [run_of(benches[k], case, number) for k, case in zip(places, cases, strict=True)]
        if limits:
            runs = [
                replace(run, most_work=limits[k][case.label])
                for k, case, run in zip(places, cases, runs, strict=True)
            ]
        wanted = signals(runs[0])
        outputs = runs[0].model.Output._fields if wanted is None else wanted.signals
        ends = () if wanted is None else wanted.ends
        kinds = [benches[k].engine if engine == "auto" else engine for k in places]
        if ends and (kinds[0] == CUDA or any(run.changes for run in runs)):
            both, ends = {*outputs, *ends}, ()
            outputs = tuple(name for name in runs[0].model.Output._fields if name in both)
        check_memory(runs[0], len(runs) * len(outputs))
        report = None if progress is None else partial(progress, cases[0].label)
        kept = {(case.settle, case.keep) for case in cases}
        computing = {"auto" if kind == "compiled" else kind for kind in kinds}
        is_alike = len(computing) == 1 and len(kept) == 1
        if is_alike and len(runs) > 1 and fit_lanes(runs, kinds[0]):
            times = runs[0].schedule().record_times - cases[0].settle
            first = int(np.searchsorted(times, -cases[0].keep - 1e-9))
            group = simulate_group(runs, outputs, threads, report, first, kinds[0], ends)
            yield Round(places, cases, runs, group)
        else:
            yield Round(places, cases, runs, _one_by_one(runs, report, kinds))


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


# --- Key figures and warnings, without recordings for anybody to look at


@dataclass(frozen=True)
class KeyFigures:
    """What benches of one experiment gave, without recordings.

    Parameters
    ----------
    figures
        Key figures, each of all benches.
    warnings
        What the runs of each bench warned of.
    """

    figures: tuple[KpiOfCases, ...]
    warnings: tuple[tuple[str, ...], ...]

    def kpis(self, k: int) -> tuple[Kpi, ...]:
        """Return the key figures of one bench."""
        return tuple(figure.case(k) for figure in self.figures)


def key_figures_of(benches: Sequence[Bench], threads: int | None = None) -> KeyFigures:
    """Return the key figures of several benches of one experiment, as `run_benches` gives them.

    Parameters
    ----------
    benches
        Benches of one experiment and the same choices.
    threads
        Threads to use, >= 1; all cores by default.

    Raises
    ------
    StepError
        When the runs do not fit into this machine.
    RunError
        When a run fails.
    KeyboardInterrupt
        When interrupted.
    """
    judge, options = benches[0].definition.judge, [bench.chosen_options for bench in benches]
    families = judge if isinstance(judge, FamilyJudge) and _is_plain(benches[0]) else None
    recordings: list[dict[str, Any]] = [static_recordings(bench) for bench in benches]
    warnings: list[list[str]] = [[] for _ in benches]
    wanted = set() if families is None else families.signals(options)
    signals = partial(needed, wanted) if families is not None else lambda _: None
    figures: tuple[KpiOfCases, ...] | None = None
    for made in rounds(benches, threads=threads, signals=signals):
        group = made.trajectories
        if not isinstance(group, RunGroup):
            _recorded(benches, made, recordings, warnings)
            continue
        rows = rows_of_group(group, made.cases[0].settle)
        said = watch_cases(
            rows, group.runs, group.unsettled.tolist(), _books(made, group, rows, threads)
        )
        for k, case, texts in zip(made.places, made.cases, said, strict=True):
            warnings[k] += _labeled(benches[k], case, texts)
        if families is not None:
            if benches[0].definition.beside is not None:
                rows = inputs_recorded(rows, made.cases, wanted)
            figures = families.of_cases(rows, options, [run.par for run in group.runs])
            continue
        for j, (k, case) in enumerate(zip(made.places, made.cases, strict=True)):
            recordings[k][case.label] = rows_of_case(benches[k], case, rows, group, j)
    if figures is None:
        figures = tuple(of_cases(list(map(judge, recordings, options))))
    return KeyFigures(figures, tuple(map(tuple, warnings)))


def _is_plain(bench: Bench) -> bool:
    """Return whether an experiment makes one run, to whose recording nothing is added."""
    definition = bench.definition
    return definition.static is None and definition.finish is None and len(bench.cases()) == 1


def needed(wanted: set[str], run: Run) -> Wanted | None:
    """Return the outputs that key figures, warnings and books of energy look at; None for all."""
    watched, names = run.model.watched(run.par), run.model.Output._fields
    if watched is None:
        return None
    rows, booked = {*wanted, *watched}, set(energy_signals(run))
    return Wanted(
        tuple(name for name in names if name in rows),
        tuple(name for name in names if name in booked - rows),
    )


def _books(made: Round, group: RunGroup, rows: Rows, threads: int | None) -> list[list[str]]:
    """Return what every run warns of because its energies cannot be true.

    Their ends tell of most runs that they can; where they do not, all rows are computed.
    """
    if group.end_names:
        if are_surely_sound(cast(xr.Dataset, ends_of_group(group)), made.runs):
            return [[] for _ in made.runs]
        every, first = energy_signals(made.runs[0]), group.runs[0].schedule().rows
        group = simulate_group(made.runs, every, threads, first=first - group.time.size)
        rows = rows_of_group(group, made.cases[0].settle)
    return energy_doubts_of_cases(cast(xr.Dataset, rows), len(made.runs), made.runs)


def _recorded(
    benches: Sequence[Bench],
    made: Round,
    recordings: list[dict[str, Any]],
    warnings: list[list[str]],
) -> None:
    """Add what runs recorded that were computed one after the other."""
    for k, case, run, trajectory in zip(
        made.places, made.cases, made.runs, made.trajectories, strict=True
    ):
        recordings[k][case.label], said = rows_recorded(benches[k], case, run, trajectory)
        warnings[k] += _labeled(benches[k], case, said)


def _labeled(bench: Bench, case: Case, texts: Sequence[str]) -> list[str]:
    """Return warnings, with the run's label where there are several."""
    return [f"{case.label}: {t}" for t in texts] if len(bench.cases()) > 1 else list(texts)
