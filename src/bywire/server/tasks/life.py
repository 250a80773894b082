"""How a brake wears over thousands of stops."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bywire.core import option_texts as texts
from bywire.core.typing import Progress
from bywire.report.answer import Answer
from bywire.server.common_fields import bench_changes, changes_of, names, path_of
from bywire.server.field import Field
from bywire.server.place import Place
from bywire.server.task import Task

if TYPE_CHECKING:
    from bywire.life.life_file import LifePlan


def _plan(asked: Mapping[str, Any], place: Place) -> LifePlan:
    from bywire.life.life_file import read_life

    return read_life(path_of(asked["life"], place), changes_of(asked, place))


def _check(asked: Mapping[str, Any], place: Place) -> None:
    from bywire.api.life import require_checkable

    require_checkable(asked["check"], _plan(asked, place))


def _compute(asked: Mapping[str, Any], out: Path, progress: Progress) -> Answer:
    from bywire.api.life import project_life

    return project_life(asked["life"], asked["set"], check=asked["check"], progress=progress)


TASK = Task(
    "life",
    "Life",
    "Project",
    (
        Field(
            "life",
            "Life",
            "thing",
            texts.LIFE,
            names("lives"),
            lambda there: list(there.lives),
            is_required=True,
            fits=lambda asked, place: _plan({**asked, "set": {}}, place),
        ),
        bench_changes(_plan),
        Field("check", "Stops one by one", "whole", texts.LIFE_CHECK, default=0, fits=_check),
    ),
    _compute,
    subject="life",
    summary="How a brake wears over thousands of stops, and when its life ends",
)
