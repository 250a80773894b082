"""Gains of a loop from requirements."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from bywire.core.typing import Progress
from bywire.report.answer import Answer
from bywire.server.task import Field, Task


def _loops() -> Sequence[str]:
    from bywire.api.overview import overview

    return sorted(overview().things["loops"])


def _compute(asked: Mapping[str, Any], out: Path, progress: Progress) -> Answer:
    from bywire.api.design import design

    return design(
        asked["loop"], asked["parameters"], asked["at"], asked["set"], require=asked["require"],
        over=asked["over"], amplitudes=asked["amplitudes"], schedule=asked["schedule"],
        linear_only=asked["linear_only"], progress=progress,
    )  # fmt: skip


TASK = Task(
    "design", "Design a loop", "Design",
    (
        Field("loop", "Loop", choices=_loops, is_required=True),
        Field("require", "Requirements", "lines", "bandwidth >= 10 Hz, one in a line"),
        Field("at", "Operating point", hint="20 bar"),
        Field("over", "Ranges to serve too", "lines", "motor.R_m=0.2ohm:0.6ohm:5"),
        Field("linear_only", "Leave out the nonlinear bench (quicker)", "flag"),
        Field("schedule", "Gains by region (operating points then lists one of each)", "flag"),
        Field("amplitudes", "Amplitudes of the sines on the bench", hint="1 bar, 3 bar"),
        Field("parameters", "Parameter set", hint="the main one by default"),
        Field("set", "Changes", "changes", "motor.R_m=0.4 ohm, one in a line"),
    ),
    _compute, subject="loop",
)  # fmt: skip
