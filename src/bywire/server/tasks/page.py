"""The live page of a bench."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from bywire.core.typing import Progress
from bywire.report.answer import Answer
from bywire.server.common_fields import bench, case
from bywire.server.task import Task


def _compute(asked: Mapping[str, Any], out: Path, progress: Progress) -> Answer:
    from bywire.api.page import page

    return page(asked["bench"], out, case=asked["case"])


TASK = Task(
    "page",
    "Live page",
    "Make the page",
    (bench(), case()),
    _compute,
    is_file=True,
)
