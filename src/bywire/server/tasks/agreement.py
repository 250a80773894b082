"""What makes a loop nonlinear, cause by cause."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from bywire.core import option_texts as texts
from bywire.core.typing import Progress
from bywire.report.answer import Answer
from bywire.server.common_fields import case_of, frequencies, of_loops, side
from bywire.server.field import Field
from bywire.server.place import Place
from bywire.server.task import Task


def _fit(asked: Mapping[str, Any], place: Place) -> object:
    from bywire.api.agreement import two_amplitudes

    return two_amplitudes(case_of(asked), asked["amplitudes"])


def _compute(asked: Mapping[str, Any], out: Path, progress: Progress) -> Answer:
    from bywire.api.agreement import agreement

    return agreement(
        asked["loop"],
        asked["parameters"],
        asked["at"],
        asked["set"],
        frequencies=asked["frequencies"],
        amplitudes=asked["amplitudes"],
        progress=progress,
        side=asked["side"],
    )


TASK = Task(
    "agreement",
    "Nonlinearity of a loop",
    "Measure",
    (
        *of_loops(),
        frequencies(),
        Field("amplitudes", "Amplitudes", hint=texts.AGREEMENT_AMPLITUDES, fits=_fit),
        side(),
    ),
    _compute,
    subject="loop",
    summary="What makes a loop nonlinear, cause by cause",
)
