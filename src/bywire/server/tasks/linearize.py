"""The exact linear model of a closed loop, or of a plant."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bywire.core import option_texts as texts
from bywire.core.typing import Progress
from bywire.report.answer import Answer
from bywire.server.common_fields import changes, loop, parameters, side
from bywire.server.field import Field, Fits
from bywire.server.place import Place
from bywire.server.task import Task

if TYPE_CHECKING:
    from bywire.api.linearize_plant import PlantCase
    from bywire.api.loop_case import LoopCase

_ASKED = ("parameters", "set", "at", "friction", "speed")


def _case(asked: Mapping[str, Any]) -> LoopCase | PlantCase:
    from bywire.api.linearize import linear_case

    return linear_case(
        asked["loop"],
        asked["parameters"],
        asked["at"],
        asked["set"],
        asked["friction"],
        asked["speed"],
    )


def _with(*wanted: str) -> Fits:
    """Return what tries out some of the fields, the others left out."""

    def fit(asked: Mapping[str, Any], place: Place) -> object:
        del place
        empty = {name: type(asked[name])() for name in _ASKED if name not in wanted}
        return _case({**asked, **empty})

    return fit


def _range(asked: Mapping[str, Any], place: Place) -> object:
    from bywire.api.linearize_plant import PlantCase
    from bywire.api.loop_case import range_of

    del place
    case = _case(asked)
    quantity = case.point.quantity if isinstance(case, PlantCase) else case.loop.at
    return range_of(asked["locus"], quantity, case.par, "--locus")


def _compute(asked: Mapping[str, Any], out: Path, progress: Progress) -> Answer:
    from bywire.api.linearize import linearize

    return linearize(
        asked["loop"],
        asked["parameters"],
        asked["at"],
        asked["set"],
        locus=asked["locus"],
        reduce=asked["reduce"],
        friction=asked["friction"],
        speed=asked["speed"],
        dither=asked["dither"],
        side=asked["side"],
    )


TASK = Task(
    "linearize",
    "Linear model",
    "Linearize",
    (
        loop(texts.LOOP_OR_PLANT, "plants"),
        parameters(_with("parameters")),
        Field("at", "Operating point", hint=texts.AT, fits=_with("parameters", "at")),
        changes(_with("parameters", "set")),
        Field("reduce", "Reduce", hint=texts.REDUCE),
        Field(
            "friction",
            "Dry friction",
            "choice",
            texts.FRICTION,
            lambda: ("removed", "sliding", "stuck"),
            fits=_with("friction", "speed"),
        ),
        Field("speed", "Speed", hint=texts.SPEED, fits=_with("friction", "speed")),
        Field("locus", "Root locus", hint=texts.LOCUS, fits=_range),
        Field("dither", "Under dither", "flag", texts.DITHER),
        side(),
    ),
    _compute,
    subject="loop",
    summary="The exact linear model of a closed loop, with its sampling, or of a plant",
)
