"""Benches laid beside each other: result folders as they lie, all else run now."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import TypeVar

from bywire.api.compared_run import ComparedRun, kept, ran
from bywire.api.comparison import Comparison
from bywire.bench import bench_file, running
from bywire.bench.bench import Bench
from bywire.bench.bench_source import names_experiment
from bywire.bench.result import Result
from bywire.bench.result_folder import is_result_folder
from bywire.bench.running import Progress
from bywire.core.errors import ParameterError
from bywire.report.answer import use_case
from bywire.report.wording import clean

Comparable = Bench | Result | str | Path
Run = TypeVar("Run", bound=Comparable)


@use_case
def compare(
    *runs: Comparable,
    overrides: Mapping[str, str] = MappingProxyType({}),
    is_full: bool = False,
    progress: Progress | None = None,
    estimate_error: bool = True,
) -> Comparison:
    """Lay benches beside each other: what differs, key figures, verdicts, curves.

    Parameters
    ----------
    runs
        Two or more, each a result folder (what ``run --out`` or `BenchResult.write` leaves), a
        `BenchResult`, or what is run now: a `Bench`, a bench file, an experiment's name. A result
        folder goes before an experiment of its name.
    overrides
        Changes of every bench that is run now, as ``--set`` takes them.
    is_full
        Whether settings and key figures that are the same are shown as well.
    progress
        Called with a label and the finished share, 0 to 1.
    estimate_error
        Whether what is run now is run in half and double steps too; see `bywire.run`. Key figures
        that differ by less than both are off, as estimated or as a folder says, are not distinct.

    Returns
    -------
    Comparison
        What differs in settings and parameters, and the key figures of all runs in SI units.

    Raises
    ------
    InputError
        For fewer than two runs, folders that are not finished or damaged, and benches that
        cannot be set up.
    RunError
        When a run fails.
    KeyboardInterrupt
        When interrupted: half a run compares with nothing.
    """
    require_comparable(runs, overrides)
    places = [k for k, each in enumerate(runs) if _is_folder(each)]
    # Folders first: what they lack is said before anything is computed.
    read = {k: kept(Path(str(runs[k]))) for k in places}
    shown = [
        read.get(k) or _resolved(each, overrides, progress, estimate_error)
        for k, each in enumerate(runs)
    ]
    return Comparison(tuple(_told_apart(shown)), is_full)


def require_comparable(runs: Sequence[Run], overrides: Mapping[str, str]) -> list[Run]:
    """Return those of some runs that are to be run yet, which changes have an effect on.

    Raises
    ------
    ParameterError
        For fewer than two runs, and changes without effect.
    """
    if len(runs) < 2:
        raise ParameterError(
            f"{len(runs)} {'run is' if len(runs) == 1 else 'runs are'} nothing to compare: name "
            "two at least, bench files, experiments or result folders"
        )
    benches = [each for each in runs if not _was_run(each)]
    if overrides and not benches:
        raise ParameterError(
            f"{', '.join(overrides)} would have no effect: what is compared was run before"
        )
    return benches


def _was_run(source: Comparable) -> bool:
    return isinstance(source, Result) or _is_folder(source)


def _is_folder(source: Comparable) -> bool:
    """Return whether something is to be read as a result folder."""
    if not isinstance(source, str | Path):
        return False
    path = Path(source)
    if not path.is_dir():
        return False
    return is_result_folder(path) or not names_experiment(source)


def _resolved(
    source: Comparable,
    overrides: Mapping[str, str],
    progress: Progress | None,
    estimate_error: bool,
) -> ComparedRun:
    """Return what a bench gives, run now unless it was."""
    if isinstance(source, Result):
        result, text = source, "given"
    elif isinstance(source, Bench):
        bench = source.with_overrides(overrides) if overrides else source
        result, text = _run(bench, progress, estimate_error), "a bench, run now"
    else:
        bench = bench_file.read(source, overrides)
        result, text = _run(bench, progress, estimate_error), f"{source}, run now"
    if result.status == "interrupted":
        raise KeyboardInterrupt
    return ran(result, result.bench.name or result.bench.experiment, text)


def _run(bench: Bench, progress: Progress | None, estimate_error: bool) -> Result:
    name = bench.name or bench.experiment
    report = None if progress is None else partial(_reported, progress, name)
    return running.run(bench, report, estimate_error=estimate_error)


def _reported(progress: Progress, name: str, label: str, share: float) -> None:
    progress(f"{name}, {label}", share)


def _told_apart(runs: Sequence[ComparedRun]) -> list[ComparedRun]:
    """Return runs whose labels differ: by their sources, and else by their numbers."""
    labels = [clean(each.label) for each in runs]
    if len(set(labels)) < len(runs):
        labels = [clean(each.source) for each in runs]
    if len(set(labels)) < len(runs):
        labels = [f"{k + 1}: {clean(each.label)}" for k, each in enumerate(runs)]
    return [replace(each, label=label) for each, label in zip(runs, labels, strict=True)]
