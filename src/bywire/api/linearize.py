"""The exact linear model of a closed loop, with its sampling, or of a plant."""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import numpy as np

from bywire.analysis.linear.plant import PLANTS
from bywire.analysis.locus import Locus, locus
from bywire.analysis.loop import LOOPS
from bywire.analysis.periodic import PeriodicModel, dithered_loop
from bywire.api import linear_texts as texts
from bywire.api.linearize_answer import LinearizedLoop
from bywire.api.linearize_plant import (
    LinearizedPlant,
    PlantCase,
    PlantLocus,
    linearize_plant,
    plant_case,
    plant_locus,
)
from bywire.api.loop_case import LoopCase, loop_case, over_range
from bywire.bench.step_error import NO_ESTIMATE, OTHER_STEPS, of_difference
from bywire.core.catalog import main_set, parameters
from bywire.core.errors import ParameterError
from bywire.report.answer import use_case


@use_case
def linearize(
    name: str,
    parameters: str = "",
    at: str = "",
    overrides: Mapping[str, Any] = MappingProxyType({}),
    *,
    locus: str = "",
    reduce: str = "",
    friction: str = "",
    speed: str = "",
    dither: bool = False,
    side: str = "",
) -> LinearizedLoop | LinearizedPlant | PlantLocus:
    """Return the exact linear model of a closed loop or of a plant.

    Parameters
    ----------
    name
        Name of a loop or of a plant.
    parameters
        Parameter set; the main one of its brake by default.
    at
        Operating point with its unit, for instance ``"20 bar"``; the loop's own by default.
    overrides
        Other parameters by dotted name: SI numbers, or texts with units.
    locus
        Range over which the poles are followed, ``"NAME=LOW:HIGH:COUNT"``.
    reduce
        An order, or a band such as ``"150 Hz"``, to which the model is reduced.
    friction, speed
        Of a plant: ``"removed"``, ``"sliding"`` or ``"stuck"``, and the motor's speed of sliding.
    dither
        Of a loop: whether it is also linearized about its motion under dither, friction on.
    side
        As of `bywire.margins`.

    Returns
    -------
    LinearizedLoop, LinearizedPlant or PlantLocus
        The linear model, SI units inside, with its poles in 1/s; along a range its poles alone.

    Raises
    ------
    InputError
        For names that are unknown, values out of range, and options that do not fit together.
    SolverError
        When the motion under dither does not repeat itself.
    """
    if name in PLANTS.all():
        if dither:
            raise ParameterError("--dither is for loops: leave it out, or name a loop")
        if locus and reduce:
            raise ParameterError("--reduce and --locus exclude each other: ask for one of them")
        if locus:
            return plant_locus(name, parameters, at, overrides, friction, speed, locus, side)
        return linearize_plant(name, parameters, at, overrides, friction, speed, reduce, side)
    case = _loop_case(name, parameters, at, overrides, friction, speed, side)
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
        As of `linearize`.

    Raises
    ------
    InputError
        As `linearize`.
    """
    if name in PLANTS.all():
        return plant_case(name, parameters, at, overrides, friction, speed, side)
    return _loop_case(name, parameters, at, overrides, friction, speed, side)


def _loop_case(
    name: str,
    parameters: str,
    at: str,
    overrides: Mapping[str, Any],
    friction: str,
    speed: str,
    side: str,
) -> LoopCase:
    if name not in LOOPS.all():
        raise LOOPS.unknown(name, PLANTS)
    for option, given in (("--friction", friction), ("--speed", speed)):
        if given:
            raise ParameterError(
                f"{option} is for plants ({', '.join(PLANTS.all())}): controllers are linearized "
                "without dry friction; leave it out"
            )
    return loop_case(name, parameters, at, overrides, side)


def _followed(case: LoopCase, range_: str) -> Locus:
    name, unit, values = over_range(range_, case, "--locus")
    return locus(case.loop, case.par, case.value, name, unit, sorted(values))


def _dithered(case: LoopCase) -> PeriodicModel:
    if not case.loop.whole(case.par):
        raise ParameterError(
            f"--dither: loop {case.loop.name!r} of {case.name} has none; it takes a loop through "
            f"which a dither runs ({_dithered_loops()}), switched on in the parameters of its ECU"
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
