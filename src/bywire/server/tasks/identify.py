"""Parameters with their confidence, from measurement files or a simulated experiment."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from bywire.core import option_texts as texts
from bywire.core.typing import Progress
from bywire.report.answer import Answer
from bywire.server.common_fields import bench, case, changes, mapping, names, parameters, time
from bywire.server.field import Field
from bywire.server.task import Task


def _compute(asked: Mapping[str, Any], out: Path, progress: Progress) -> Answer:
    from bywire.api.identify import identify
    from bywire.identification.fitting.question import Question

    question = Question(
        asked["bench"] or None,
        asked["inputs"],
        asked["outputs"],
        asked["unknowns"],
        asked["priors"],
        asked["states"],
        asked["case"],
        asked["holdout"] or None,
        asked["loss"],
    )
    return identify(
        asked["method"],
        asked["measurements"],
        asked["parameters"],
        asked["set"],
        question=question,
        mapping=asked["mapping"] or None,
        time=asked["time"],
        options=asked["options"],
        starts=asked["starts"],
        seed=asked["seed"],
        synthetic=asked["synthetic"],
        folder=out,
        progress=progress,
    )


TASK = Task(
    "identify",
    "Identify parameters",
    "Identify",
    (
        Field("method", "Method", "choice", texts.METHOD, names("methods"), is_required=True),
        Field("measurements", "Measurements", "files", texts.MEASUREMENTS),
        Field("synthetic", "Simulated measurement", "whole", texts.SYNTHETIC),
        mapping(),
        time(),
        bench(is_required=False),
        Field("inputs", "Inputs", "pairs", texts.INPUTS),
        Field("outputs", "Outputs", "names", texts.NOISY_OUTPUT),
        Field("unknowns", "Unknowns", "names", texts.UNKNOWN),
        Field("priors", "Known before", "pairs", texts.PRIOR),
        Field("states", "Unknown initial values", "lines", texts.START),
        Field("holdout", "Measurement for validation", "file", texts.HOLDOUT),
        Field(
            "loss", "Loss", "choice", texts.LOSS, lambda: ("linear", "soft_l1", "huber", "cauchy")
        ),
        case(),
        Field("options", "Options of the method", "changes", texts.METHOD_OPTION),
        Field("starts", "Starts of the search", "whole", texts.STARTS, default=16, least=1),
        Field("seed", "Seed of the starts", "whole", texts.SEED, default=1),
        parameters(),
        changes(),
    ),
    _compute,
    subject="method",
    summary="Parameters with their confidence from measured experiments, or a simulated one",
)
