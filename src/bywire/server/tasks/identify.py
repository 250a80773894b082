"""Parameters with their confidence, from measurement files or a simulated experiment."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from bywire.core.errors import ParameterError, quoted
from bywire.core.typing import Progress
from bywire.report.answer import Answer
from bywire.server.task import Field, Task


def _methods() -> Sequence[str]:
    from bywire.api.overview import overview

    return sorted(overview().things["methods"])


def _whole(text: str, name: str, default: int | None) -> int | None:
    """Return a whole number that a field holds."""
    if not text:
        return default
    if not text.isdecimal() or len(text) > 9:
        raise ParameterError(f"{name} = {quoted(text)}: a whole number is wanted")
    return int(text)


def _compute(asked: Mapping[str, Any], out: Path, progress: Progress) -> Answer:
    from bywire.api.identify import identify
    from bywire.identification.fitting.question import Question

    question = Question(
        asked["bench"] or None, asked["inputs"], asked["outputs"], asked["unknowns"],
        asked["priors"], asked["states"], asked["case"], asked["holdout"] or None, asked["loss"],
    )  # fmt: skip
    starts, seed = _whole(asked["starts"], "starts", 16), _whole(asked["seed"], "seed", 1)
    assert starts is not None
    assert seed is not None
    return identify(
        asked["method"], asked["measurements"], asked["parameters"], asked["set"],
        question=question, mapping=asked["mapping"] or None,
        options=asked["options"], starts=max(starts, 1), seed=seed,
        synthetic=_whole(asked["synthetic"], "synthetic", None), folder=out, progress=progress,
    )  # fmt: skip


TASK = Task(
    "identify", "Identify parameters", "Identify",
    (
        Field("method", "Method", choices=_methods, is_required=True),
        Field("measurements", "Measurements", "files"),
        Field("synthetic", "Simulated measurement instead", hint="its seed, for instance 1"),
        Field("mapping", "What the columns mean", "file", "a TOML file"),
        Field("bench", "Bench", "bench", "for methods of any bench"),
        Field("inputs", "What drives the model", "pairs", "STIMULUS=SIGNAL, one in a line"),
        Field("outputs", "What is measured", "names", "p_mc=0.02 bar, with its noise or without"),
        Field("unknowns", "What is searched", "names", "motor.R_m=0.1..1 ohm, one in a line"),
        Field("priors", "What is known of it", "pairs", "motor.R_m=0.35 +- 0.02 ohm"),
        Field("states", "Unknown initial values", "lines", "omega, one in a line"),
        Field("holdout", "Measurement for validation", "file"),
        Field("loss", "Loss", choices=lambda: ("", "linear", "soft_l1", "huber", "cauchy")),
        Field("case", "Run", hint="the first by default"),
        Field("options", "Options of the method", "changes", "KEY=VALUE, one in a line"),
        Field("starts", "Starts of the search", hint="16"),
        Field("seed", "Seed of the starts", hint="1"),
        Field("parameters", "Parameter set", hint="the method's own by default"),
        Field("set", "Changes", "changes", "motor.R_m=0.4 ohm, one in a line"),
    ),
    _compute, subject="method",
)  # fmt: skip
