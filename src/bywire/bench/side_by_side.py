"""The runs of several benches: side by side where they differ in numbers alone."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from bywire.bench.bench import Bench
from bywire.bench.experiment import Case
from bywire.bench.extent import check_memory
from bywire.bench.running import Progress, run_of
from bywire.simulation.engine import CUDA
from bywire.simulation.run import Run, Trajectory, simulate
from bywire.simulation.run_group import fit_lanes, simulate_group


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
