"""Gains of a loop from requirements."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from bywire.core import option_texts as texts
from bywire.core.typing import Progress
from bywire.report.answer import Answer
from bywire.server.common_fields import case_of, changes, loop, parameters, side
from bywire.server.field import Field
from bywire.server.task import Task


def _compute(asked: Mapping[str, Any], out: Path, progress: Progress) -> Answer:
    from bywire.api.design import design

    return design(
        asked["loop"],
        asked["parameters"],
        asked["at"],
        asked["set"],
        require=asked["require"],
        over=asked["over"],
        amplitudes=asked["amplitudes"],
        schedule=asked["schedule"],
        linear_only=asked["linear_only"],
        progress=progress,
        side=asked["side"],
    )


TASK = Task(
    "design",
    "Design a loop",
    "Design",
    (
        loop(),
        Field("require", "Requirements", "lines", texts.DESIGN_REQUIRE),
        Field("at", "Operating point", hint=texts.AT),
        Field("over", "Ranges", "lines", texts.DESIGN_OVER),
        Field("linear_only", "Linear only (quicker)", "flag", texts.DESIGN_LINEAR),
        Field("schedule", "Gains by region", "flag", texts.DESIGN_SCHEDULE),
        Field("amplitudes", "Amplitudes", hint=texts.DESIGN_AMPLITUDES),
        parameters(lambda asked, _: case_of({**asked, "at": "", "set": {}})),
        changes(lambda asked, _: case_of({**asked, "at": ""})),
        side(),
    ),
    _compute,
    subject="loop",
    summary="Gains of a control loop from requirements",
)
