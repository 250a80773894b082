"""Runs of a bench as pages that play them."""

from __future__ import annotations

from pathlib import Path

from bywire.bench.bench import Bench
from bywire.bench.running import Result
from bywire.core.errors import ParameterError
from bywire.report.animation.page import scene_page
from bywire.report.animation.scene import SCENES
from bywire.report.document import Attachment
from bywire.report.drawing import write_bytes


def require_scene(bench: Bench, over: str = "") -> None:
    """Refuse benches whose runs cannot be played.

    Raises
    ------
    ParameterError
        When the bench's assembly declares no animation, or a range of values is run.
    """
    assembly, known = bench.definition.assembly, SCENES.all()
    if assembly not in known:
        raise ParameterError(
            f"{bench.experiment}: runs of {assembly} have no animation, those of "
            f"{' and '.join(known)} have: leave animate out, or declare a SceneKind in a module "
            "'animations' of the brake"
        )
    if over:
        raise ParameterError("an animation shows single runs: leave either animate or over out")


def playable(result: Result) -> list[str]:
    """Return the labels of the runs that an animation can show."""
    place = SCENES.find(result.bench.definition.assembly).place
    return [label for label, run in result.recordings.items() if place in run]


def animations(result: Result) -> list[Attachment]:
    """Return a page for each run of a result, as files of its folder."""
    labels, draw = playable(result), SCENES.find(result.bench.definition.assembly).draw
    several = len(labels) > 1
    title = result.bench.name or result.bench.experiment

    def page(label: str) -> Attachment:
        def write(path: Path) -> Path:
            heading = f"{title}, {label}" if several else title
            text = scene_page(draw(result.recordings[label]), heading, _SAID)
            return write_bytes(path, text.encode())

        return Attachment(f"animation-{label}.html" if several else "animation.html", write)

    return [page(label) for label in labels]


_SAID = (
    "Where a tyre slides it marks the road; where its wheel stands the mark is black. Arrows are "
    "braking forces, as long as a meter where they are as large as the weight."
)
