"""Exact linear models of sampled loops and of plants."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any

from bywire.usecases.asks import At, Changes, ParameterSetName, Side
from bywire.usecases.declare import NOTHING, Ask, Form, use_case

if TYPE_CHECKING:
    from bywire.api.linearize import LinearizedLoop, LinearizedPlant, PlantCase, PlantLocus
    from bywire.api.loop_case import LoopCase

LoopOrPlant = Annotated[
    str, Ask("Loop or plant, see 'bywire list'.", "Loop", name="loop", known=("loops", "plants"))
]
LocusRange = Annotated[str, Ask("Poles over a range, e.g. motor.R_m=0.1ohm:1ohm:71.", "Root locus")]
Reduce = Annotated[
    str, Ask("Reduce it to an order, e.g. 4, or to a band, e.g. '150 Hz'.", "Reduce")
]
FrictionKind = Annotated[
    str,
    Ask(
        "Of a plant: removed (as of loops), sliding, or stuck.",
        "Dry friction",
        words=("removed", "sliding", "stuck"),
    ),
]
Speed = Annotated[str, Ask("Motor speed of sliding, e.g. '5 rad/s'.", "Speed")]
Dither = Annotated[bool, Ask("Also about its motion under dither, friction on.", "Under dither")]


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
    """Make the exact linear model of a closed loop, with its sampling, or of a plant.

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
    from bywire.api.linearize import linearized

    case = _read(name, parameters, at, overrides, locus, friction, speed, side)
    return linearized(case, locus, reduce, dither)
