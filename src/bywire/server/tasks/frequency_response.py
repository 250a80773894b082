"""A closed loop's response by amplitude, on the nonlinear model."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from bywire.core import option_texts as texts
from bywire.core.typing import Progress
from bywire.report.answer import Answer
from bywire.server.common_fields import (
    case_of,
    error_estimate,
    frequencies,
    of_loops,
    over,
    side,
)
from bywire.server.field import Field
from bywire.server.place import Place
from bywire.server.task import Task


def _fit(asked: Mapping[str, Any], place: Place) -> object:
    from bywire.api.loop_case import spread

    return spread(asked["amplitudes"], case_of(asked).input_unit, "amplitudes")


def _compute(asked: Mapping[str, Any], out: Path, progress: Progress) -> Answer:
    from bywire.api.frequency_response import frequency_response

    return frequency_response(
        asked["loop"],
        asked["parameters"],
        asked["at"],
        asked["set"],
        frequencies=asked["frequencies"],
        amplitudes=asked["amplitudes"],
        excitation=asked["excitation"] or "sine",
        over=asked["over"],
        progress=progress,
        estimate_error=asked["error_estimate"],
        side=asked["side"],
    )


TASK = Task(
    "frequency-response",
    "Frequency response",
    "Measure",
    (
        *of_loops(),
        frequencies(),
        Field("amplitudes", "Amplitudes", hint=texts.AMPLITUDES, fits=_fit),
        Field(
            "excitation",
            "Excitation",
            "choice",
            texts.EXCITATION,
            lambda: ("sine", "multisine", "chirp"),
        ),
        over(texts.BANDWIDTH_OVER),
        error_estimate(),
        side(),
    ),
    _compute,
    subject="loop",
    summary="A closed loop's response by amplitude: friction, limits and sampling included",
)
