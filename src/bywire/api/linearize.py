"""The exact linear model of a closed loop, with its sampling, or of a plant."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from bywire.analysis.linear.plant import PLANTS
from bywire.analysis.locus import Locus, locus
from bywire.analysis.loop import LOOPS
from bywire.analysis.periodic import PeriodicModel, dithered_loop
from bywire.api import linear_texts as texts
from bywire.api.linearize_answer import LinearizedLoop
from bywire.api.linearize_plant import (
    PlantCase,
    plant_case,
)
from bywire.api.loop_case import LoopCase, loop_case, range_of
from bywire.bench.step_error import NO_ESTIMATE, OTHER_STEPS, of_difference
from bywire.core.callers import option
from bywire.core.catalog import main_set, parameters
from bywire.core.errors import ParameterError


def linearized_loop(case: LoopCase, locus: str, reduce: str, dither: bool) -> LinearizedLoop:
    """Return the linear model of a loop, with what else was asked for.

    ``locus``, ``reduce``, ``dither``: as of `bywire.linearize`.
    """
    model = case.loop.closed(case.par, case.value)
    dithered = _dithered(case) if dither else None
    return LinearizedLoop(
        case,
        model,
        _followed(case, locus) if locus else None,
        texts.reduced(model, reduce, case.loop.band[1]) if reduce else None,
        dithered,
        math.nan if dithered is None else _gain_error(case, dithered),
    )


def linear_case(
    name: str,
    parameters: str,
    at: str,
    overrides: Mapping[str, Any],
    friction: str,
    speed: str,
    side: str = "",
) -> LoopCase | PlantCase:
    """Return the loop or the plant that is linearized, with its parameters and operating point.

    Parameters
    ----------
    name, parameters, at, overrides, friction, speed, side
        As of `bywire.linearize`.

    Raises
    ------
    InputError
        As `bywire.linearize`.
    """
    if name in PLANTS.all():
        return plant_case(name, parameters, at, overrides, friction, speed, side)
    return linear_loop_case(name, parameters, at, overrides, friction, speed, side)


def linear_loop_case(
    name: str,
    parameters: str,
    at: str,
    overrides: Mapping[str, Any],
    friction: str,
    speed: str,
    side: str,
) -> LoopCase:
    """Return the loop that is linearized; see `linear_case`.

    Raises
    ------
    InputError
        As `bywire.linearize`, and for what plants alone have.
    """
    if name not in LOOPS.all():
        raise LOOPS.unknown(name, PLANTS)
    for argument, given in (("friction", friction), ("speed", speed)):
        if given:
            raise ParameterError(
                f"{option(argument)} is for plants ({', '.join(PLANTS.all())}): controllers are "
                "linearized without dry friction; leave it out"
            )
    return loop_case(name, parameters, at, overrides, side)


def locus_range(case: LoopCase | PlantCase, range_: str) -> tuple[str, str, list[float]]:
    """Return name, unit and values of the range over which poles are followed.

    Raises
    ------
    InputError
        For what is no range.
    """
    quantity = case.point.quantity if isinstance(case, PlantCase) else case.loop.at
    return range_of(range_, quantity, case.par, "locus")


def _followed(case: LoopCase, range_: str) -> Locus:
    name, unit, values = locus_range(case, range_)
    return locus(case.loop, case.par, case.value, name, unit, sorted(values))


def _dithered(case: LoopCase) -> PeriodicModel:
    if not case.loop.whole(case.par):
        raise ParameterError(
            f"{option('dither', True)}: loop {case.loop.name!r} of {case.name} has none; it takes "
            f"a loop through which a dither runs ({_dithered_loops()}), switched on in the "
            "parameters of its ECU"
        )
    return dithered_loop(case.loop, case.par, case.value)


def _gain_error(case: LoopCase, model: PeriodicModel) -> float:
    """Return how far gains to small sines are off by the step, as a share: half steps beside it."""
    share, frequencies = OTHER_STEPS[0], texts.small_sines(model, case.loop.band)
    try:
        finer = dithered_loop(case.loop, case.par, case.value, share * model.run.step)
    except NO_ESTIMATE:
        return math.inf
    gains, others = (np.abs(each.response(frequencies)) for each in (model, finer))
    return of_difference(share) * float(np.max(np.abs(others / gains - 1.0)))


def _dithered_loops() -> str:
    known = LOOPS.all().values()
    return ", ".join(each.name for each in known if each.whole(parameters(main_set(each.assembly))))
