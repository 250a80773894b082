"""A bench, run with Python: recordings, key figures, the report."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from bywire.core.typing import Progress
from bywire.report.answer import Answer
from bywire.server.task import Field, Task


def _compute(asked: Mapping[str, Any], out: Path, progress: Progress) -> Answer:
    from bywire.api.run import run

    return run(asked["bench"], asked["set"], faults=asked["faults"], progress=progress)


TASK = Task(
    "run", "Run with Python", "Run",
    (
        Field("bench", "Bench", "bench", is_required=True),
        Field("set", "Changes", "changes", "motor.R_m=0.4 ohm, one in a line"),
        Field("faults", "Faults", "lines", "pressure.stuck=20 bar@1 s, one in a line"),
    ),
    _compute,
)  # fmt: skip
