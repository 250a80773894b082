"""A bench, run with Python: recordings, key figures, the report."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from bywire.core import option_texts as texts
from bywire.core.typing import Progress
from bywire.report.answer import Answer
from bywire.server.common_fields import bench, bench_changes, changes_of, path_of, read_bench
from bywire.server.field import Field
from bywire.server.place import Place
from bywire.server.task import Task


def _fit(asked: Mapping[str, Any], place: Place) -> object:
    from bywire.api.run import faulty
    from bywire.bench import bench_file

    given = bench_file.read(path_of(asked["bench"], place), changes_of(asked, place))
    return faulty(given, asked["faults"]).injections


def _compute(asked: Mapping[str, Any], out: Path, progress: Progress) -> Answer:
    from bywire.api.run import run

    return run(asked["bench"], asked["set"], faults=asked["faults"], progress=progress)


TASK = Task(
    "run",
    "Run with Python",
    "Run",
    (
        bench(),
        bench_changes(read_bench),
        Field("faults", "Faults", "lines", texts.RUN_FAULT, fits=_fit),
    ),
    _compute,
)
