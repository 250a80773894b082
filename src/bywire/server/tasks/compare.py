"""Runs beside each other: earlier results, bench files, experiments."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from bywire.core import option_texts as texts
from bywire.core.typing import Progress
from bywire.report.answer import Answer
from bywire.server.common_fields import bench_changes, changes_of, error_estimate, names, path_of
from bywire.server.contents import Contents
from bywire.server.field import Field
from bywire.server.place import Place
from bywire.server.task import Task


def _offered(there: Contents) -> Sequence[str]:
    return [*there.results, *there.benches]


def _fit(asked: Mapping[str, Any], place: Place) -> None:
    from bywire.api.compare import require_comparable
    from bywire.bench import bench_file
    from bywire.bench.result_folder import record_of

    overrides = changes_of(asked, place)
    runs = [_from_anywhere(each, place) for each in asked["runs"]]
    for each in runs:
        if each.is_dir():
            record_of(each)
    for bench in require_comparable(runs, overrides):
        bench_file.read(bench, overrides)


def _from_anywhere(name: str, place: Place) -> Path:
    """Return where a run is; a result goes before an experiment of its name."""
    from bywire.bench.bench_source import names_experiment
    from bywire.bench.result_folder import is_result_folder

    path = place.root / name
    if path.is_dir() and (is_result_folder(path) or not names_experiment(name)):
        return path
    return path_of(name, place)


def _compute(asked: Mapping[str, Any], out: Path, progress: Progress) -> Answer:
    from bywire.api.compare import compare

    return compare(
        *asked["runs"],
        overrides=asked["set"],
        is_full=asked["full"],
        progress=progress,
        estimate_error=asked["error_estimate"],
    )


TASK = Task(
    "compare",
    "Compare runs",
    "Compare",
    (
        Field(
            "runs",
            "Runs",
            "things",
            texts.COMPARE_RUNS,
            names("experiments", "generic_experiments"),
            _offered,
            is_required=True,
            fits=lambda asked, place: _fit({**asked, "set": {}}, place),
        ),
        bench_changes(_fit),
        Field("full", "Show what is the same, too", "flag", texts.COMPARE_FULL),
        error_estimate(),
    ),
    _compute,
    subject="runs",
    summary="Settings and key figures that differ, verdicts, curves on top of each other",
)
