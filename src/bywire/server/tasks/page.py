"""The live page of a bench."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from bywire.core.typing import Progress
from bywire.report.answer import Answer
from bywire.server.task import Field, Task


def _compute(asked: Mapping[str, Any], out: Path, progress: Progress) -> Answer:
    from bywire.api.page import page

    return page(asked["bench"], out, case=asked["case"])


TASK = Task(
    "page", "Live page", "Make the page",
    (Field("bench", "Bench", "bench", is_required=True), Field("case", "Run")),
    _compute, is_file=True,
)  # fmt: skip
