"""Designs of a brake at equal demands: a sizing study."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from bywire.core import option_texts as texts
from bywire.core.typing import Progress
from bywire.report.answer import Answer
from bywire.server.common_fields import names, parameters
from bywire.server.field import Field
from bywire.server.place import Place
from bywire.server.task import Task


def _fit(asked: Mapping[str, Any], place: Place) -> object:
    from bywire.api.study import asked_study

    return asked_study(asked["study"], asked["parameters"], asked["set"])


def _compute(asked: Mapping[str, Any], out: Path, progress: Progress) -> Answer:
    from bywire.api.study import study

    return study(asked["study"], asked["parameters"], asked["set"], progress=progress)


TASK = Task(
    "size",
    "Sizing study",
    "Compare designs",
    (
        Field("study", "Sizing study", "choice", texts.SIZING, names("studies"), is_required=True),
        parameters(lambda asked, place: _fit({**asked, "set": {}}, place)),
        Field("set", "Changes", "changes", texts.SIZING_CHANGES, fits=_fit),
    ),
    _compute,
    subject="study",
    command="study size",
    summary="Designs of a brake at equal demands: the best, what limits it, at what price",
)
