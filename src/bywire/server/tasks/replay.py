"""A measurement file beside the simulation."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from bywire.core.typing import Progress
from bywire.report.answer import Answer
from bywire.server.task import Field, Task


def _compute(asked: Mapping[str, Any], out: Path, progress: Progress) -> Answer:
    from bywire.api.replay import replay

    return replay(
        asked["measurement"], asked["bench"], asked["set"], mapping=asked["mapping"] or None,
        inputs=asked["inputs"], outputs=asked["outputs"], case=asked["case"],
        tolerances=asked["tolerances"], segments="auto" if asked["segments"] else "",
        track=asked["track"], progress=progress,
    )  # fmt: skip


TASK = Task(
    "replay", "Replay a measurement", "Replay",
    (
        Field("bench", "Bench", "bench", is_required=True),
        Field("measurement", "Measurement", "file", is_required=True),
        Field("inputs", "What drives the model", "pairs",
              "STIMULUS=SIGNAL, one in a line; by default signals of the same name"),
        Field("outputs", "What is compared", "lines", "p_mc, one in a line; by default all"),
        Field("tolerances", "Tolerances", "lines", "nrmse <= 5 %, one in a line"),
        Field("mapping", "What the columns mean", "file", "a TOML file; needed where names or "
              "units are not those of the model"),
        Field("case", "Run", hint="the first by default"),
        Field("segments", "Judge steps and holds each for itself", "flag"),
        Field("track", "Drifting parameters", "lines", "mu_B, one in a line"),
        Field("set", "Changes", "changes", "motor.R_m=0.4 ohm, one in a line"),
    ),
    _compute,
)  # fmt: skip
