"""Benches laid beside each other: result folders as they lie, all else run now."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TypeVar

from bywire.api.compared_run import ComparedRun, ran
from bywire.bench import bench_file, running
from bywire.bench.bench import Bench
from bywire.bench.bench_source import names_experiment
from bywire.bench.result import Result
from bywire.bench.result_folder import is_result_folder
from bywire.bench.running import Progress
from bywire.core.errors import ParameterError
from bywire.report.wording import clean

Comparable = Bench | Result | str | Path
Run = TypeVar("Run", bound=Comparable)


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
    benches = [each for each in runs if not was_run(each)]
    if overrides and not benches:
        raise ParameterError(
            f"{', '.join(overrides)} would have no effect: what is compared was run before"
        )
    return benches


def was_run(source: Comparable) -> bool:
    """Return whether something was run before."""
    return isinstance(source, Result) or is_folder(source)


def is_folder(source: Comparable) -> bool:
    """Return whether something is to be read as a result folder."""
    if not isinstance(source, str | Path):
        return False
    path = Path(source)
    if not path.is_dir():
        return False
    return is_result_folder(path) or not names_experiment(source)


def resolved(
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


def told_apart(runs: Sequence[ComparedRun]) -> list[ComparedRun]:
    """Return runs whose labels differ: by their sources, and else by their numbers."""
    labels = [clean(each.label) for each in runs]
    if len(set(labels)) < len(runs):
        labels = [clean(each.source) for each in runs]
    if len(set(labels)) < len(runs):
        labels = [f"{k + 1}: {clean(each.label)}" for k, each in enumerate(runs)]
    return [replace(each, label=label) for each, label in zip(runs, labels, strict=True)]
