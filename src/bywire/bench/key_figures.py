"""Key figures and warnings of many benches, without recordings for anybody to look at."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, cast

import xarray as xr

from bywire.bench.bench import Bench
from bywire.bench.experiment import Case
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
    inputs_recorded,
    rows_of_case,
    rows_recorded,
    static_recordings,
)
from bywire.bench.side_by_side import Round, Wanted, rounds
from bywire.simulation.run import Run
from bywire.simulation.run_group import RunGroup, simulate_group


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
