"""A paper's tables and figures beside what is computed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from bywire.core import option_texts as texts
from bywire.core.typing import Progress
from bywire.report.answer import Answer
from bywire.server.field import Field
from bywire.server.task import Task


def _sources() -> Sequence[str]:
    from bywire.reproduction.reproduction import SOURCES

    return sorted(SOURCES.all())


def _compute(asked: Mapping[str, Any], out: Path, progress: Progress) -> Answer:
    from bywire.api.reproduce import reproduce

    return reproduce(asked["source"], progress=progress)


TASK = Task(
    "reproduce",
    "Reproduce a source",
    "Reproduce",
    (Field("source", "Source", "choice", texts.SOURCE, _sources, is_required=True),),
    _compute,
    subject="source",
    summary="A paper's tables and figures: stated, computed, agrees or not",
)
