"""Margins and bandwidth of a loop."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from bywire.core import option_texts as texts
from bywire.core.typing import Progress
from bywire.report.answer import Answer
from bywire.server.common_fields import of_loops, over, side
from bywire.server.task import Task


def _compute(asked: Mapping[str, Any], out: Path, progress: Progress) -> Answer:
    from bywire.api.margins import margins

    return margins(
        asked["loop"],
        asked["parameters"],
        asked["at"],
        asked["set"],
        asked["over"],
        side=asked["side"],
    )


TASK = Task(
    "margins",
    "Margins of a loop",
    "Compute",
    (*of_loops(), over(texts.MARGINS_OVER), side()),
    _compute,
    subject="loop",
    summary="Margins and bandwidth of a loop as it is sampled, and the worst case over a range",
)
