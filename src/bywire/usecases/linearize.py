"""Exact linear models of sampled loops and of plants."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any

from bywire.usecases.asks import At, Changes, ParameterSetName, Side
from bywire.usecases.declare import NOTHING, Ask, Form, use_case

if TYPE_CHECKING:
    from bywire.api.linearize import LinearizedLoop, LinearizedPlant, PlantCase, PlantLocus
    from bywire.api.loop_case import LoopCase

LoopOrPlant = Annotated[
    str, Ask("Loop or plant (see 'bywire list').", "Loop", name="loop", known=("loops", "plants"))
]
LocusRange = Annotated[
    str, Ask("Range of a root locus, e.g. motor.R_m=0.1ohm:1ohm:71.", "Root locus")
]
Reduce = Annotated[str, Ask("Order (e.g. 4) or band (e.g. '150 Hz') of a reduced model.", "Reduce")]
FrictionKind = Annotated[
    str,
    Ask(
        "Dry friction of a plant: removed (as in loops), sliding or stuck.",
        "Dry friction",
        words=("removed", "sliding", "stuck"),
    ),
]
Speed = Annotated[str, Ask("Motor speed for sliding friction, e.g. '5 rad/s'.", "Speed")]
Dither = Annotated[
    bool, Ask("Also linearize about the loop's motion under dither, with friction.", "Under dither")
]


def _read(
    name: str,
    parameters: str,
    at: str,
    overrides: Mapping[str, Any],
    locus: str,
    friction: str,
    speed: str,
    side: str,
) -> "LoopCase | PlantCase":
    from bywire.api.linearize import linear_case, locus_range

    case = linear_case(name, parameters, at, overrides, friction, speed, side)
    if locus:
        locus_range(case, locus)
    return case


@use_case(
    "linearize",
    form=Form(
        "Linear model",
        "Linearize",
        "loop",
        fields=(
            "loop",
            "parameters",
            "at",
            "set",
            "reduce",
            "friction",
            "speed",
            "locus",
            "dither",
            "side",
        ),
    ),
    check=_read,
)
def linearize(
    name: LoopOrPlant,
    parameters: ParameterSetName = "",
    at: At = "",
    overrides: Changes = NOTHING,
    *,
    locus: LocusRange = "",
    reduce: Reduce = "",
    friction: FrictionKind = "",
    speed: Speed = "",
    dither: Dither = False,
    side: Side = "",
) -> "LinearizedLoop | LinearizedPlant | PlantLocus":
    """Derive the exact linear model of a sampled closed loop or of a plant.

    Parameters
    ----------
    name
        Name of a loop or of a plant.
    parameters
        Parameter set. Default: the main one of the loop's or plant's brake.
    at
        Operating point with its unit, for instance ``"20 bar"``. Default: the loop's nominal point.
    overrides
        Changes of parameters by dotted name, as SI numbers or texts with units.
    locus
        Range of the root locus, ``"NAME=LOW:HIGH:COUNT"``.
    reduce
        Order of the reduced model, or its band, such as ``"150 Hz"``.
    friction, speed
        For a plant: ``"removed"``, ``"sliding"`` or ``"stuck"``, and the motor speed for sliding.
    dither
        For a loop: whether to also linearize about its motion under dither, with friction.
    side
        See `bywire.margins`.

    Returns
    -------
    LinearizedLoop, LinearizedPlant or PlantLocus
        The linear model in SI units, with its poles in 1/s. Over a range, only the poles.

    Raises
    ------
    InputError
        For unknown names, values out of range, and incompatible options.
    SolverError
        If the motion under dither does not become periodic.
    """
    from bywire.api.linearize import linearized

    case = _read(name, parameters, at, overrides, locus, friction, speed, side)
    return linearized(case, locus, reduce, dither)
