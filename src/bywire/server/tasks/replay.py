"""A measurement file beside the simulation."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from bywire.core import option_texts as texts
from bywire.core.typing import Progress
from bywire.report.answer import Answer
from bywire.server.common_fields import bench, bench_changes, case, mapping, read_bench, time
from bywire.server.field import Field
from bywire.server.task import Task


def _compute(asked: Mapping[str, Any], out: Path, progress: Progress) -> Answer:
    from bywire.api.replay import replay

    return replay(
        asked["measurement"],
        asked["bench"],
        asked["set"],
        mapping=asked["mapping"] or None,
        inputs=asked["inputs"],
        outputs=asked["outputs"],
        time=asked["time"],
        case=asked["case"],
        tolerances=asked["tolerances"],
        segments="auto" if asked["segments"] else "",
        track=asked["track"],
        progress=progress,
    )


TASK = Task(
    "replay",
    "Replay a measurement",
    "Replay",
    (
        bench(),
        Field("measurement", "Measurement", "file", texts.MEASUREMENT, is_required=True),
        Field("inputs", "Inputs", "pairs", texts.INPUTS),
        Field("outputs", "Outputs", "names", texts.REPLAY_OUTPUT),
        Field("tolerances", "Tolerances", "lines", texts.TOLERANCE),
        mapping(),
        time(),
        case(),
        Field("segments", "Judge steps and holds each for itself", "flag"),
        Field("track", "Drifting parameters", "lines", texts.TRACK),
        bench_changes(read_bench),
    ),
    _compute,
)
