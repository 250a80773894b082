"""Gains of a loop from requirements."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from bywire.core.libraries import on_one_thread
from bywire.usecases.asks import At, Changes, LoopName, ParameterSetName, Side
from bywire.usecases.declare import NOTHING, Ask, Command, Form, use_case

if TYPE_CHECKING:
    from bywire.api.design import LoopDesign, LoopScheduleDesign
    from bywire.core.typing import Progress

Required = Annotated[
    Sequence[str],
    Ask("Requirement, e.g. 'bandwidth >= 10 Hz'; may be repeated.", "Requirements"),
]
RequirementsFile = Annotated[str | Path | None, Ask("TOML file with a section 'requirements'.")]
Ranges = Annotated[
    Sequence[str],
    Ask("Further range to cover, e.g. motor.R_m=0.2ohm:0.6ohm:5 or at=5bar:35bar:7.", "Ranges"),
]
SineAmplitudes = Annotated[
    str, Ask("Amplitudes of the sines on the bench, e.g. '1 bar, 3 bar'.", "Amplitudes")
]
Schedule = Annotated[
    bool, Ask("Gains by region; --at then lists points of all regions.", "Gains by region")
]
LinearOnly = Annotated[bool, Ask("Leave out the nonlinear bench.", "Linear only (quicker)")]
FreeDerivative = Annotated[
    bool,
    Ask(
        "Let the derivative's filter be faster than the sampling, and differentiate the set point."
    ),
]
DrawnFrom = Annotated[
    str | Path,
    Ask(
        "Study file: gains for models drawn as its cases are, judged by others.",
        metavar="FILE",
        is_text=True,
    ),
]
Drawn = Annotated[int, Ask("Models drawn for the gains.")]
Probability = Annotated[str, Ask("Of all requirements together, e.g. '99 %'; needs --vary.")]
Seed = Annotated[int, Ask("Seed of the searches.", least=0)]


def _read(loop: str, parameters: str, overrides: Mapping[str, Any], side: str) -> None:
    from bywire.api.loop_case import loop_case

    loop_case(loop, parameters, "", overrides, side)


@use_case(
    Command("design", status_1="when they cannot be met"),
    form=Form(
        "Design a loop",
        "Design",
        "loop",
        fields=(
            "loop",
            "require",
            "at",
            "over",
            "linear_only",
            "schedule",
            "amplitudes",
            "parameters",
            "set",
            "side",
        ),
    ),
    check=_read,
)
@on_one_thread()
def design(
    loop: LoopName,
    parameters: ParameterSetName = "",
    at: At = "",
    overrides: Changes = NOTHING,
    *,
    require: Required = (),
    requirements: RequirementsFile = None,
    over: Ranges = (),
    amplitudes: SineAmplitudes = "",
    schedule: Schedule = False,
    linear_only: LinearOnly = False,
    free_derivative: FreeDerivative = False,
    vary: DrawnFrom = "",
    drawn: Drawn = 64,
    probability: Probability = "",
    seed: Seed = 0,
    progress: "Progress | None" = None,
    side: Side = "",
) -> "LoopDesign | LoopScheduleDesign":
    """Choose a loop's gains from requirements.

    Parameters
    ----------
    loop, parameters, at, overrides
        As of `bywire.margins`; parameters that are set are not chosen. With ``schedule``, ``at``
        lists points of all regions.
    require
        Requirements, for instance ``"bandwidth >= 10 Hz"``.
    requirements
        TOML file with a section ``requirements``.
    over
        Ranges to serve too, ``"NAME=LOW:HIGH:COUNT"`` each.
    amplitudes
        Of the sines on the bench, with units and commas; the loop's own by default.
    schedule
        Whether the gains are chosen by region.
    linear_only
        Whether the nonlinear bench is left out.
    free_derivative
        Whether the derivative's filter may be faster than the sampling and the set point be
        differentiated: better figures of gains that one would hardly put into an ECU.
    vary
        Study file: the gains are chosen for models that are drawn as its cases are, and judged by
        others.
    drawn
        How many models they are chosen for.
    probability
        With which all requirements are to be met together, for instance ``"99 %"``.
    seed
        Of the searches.
    progress
        Called with a label and the finished share, 0 to 1.
    side
        Of the linear models, as of `bywire.margins`.

    Returns
    -------
    LoopDesign or LoopScheduleDesign
        Gains in SI units, the figures that they give, which requirement binds, and what the bench
        shows of them.

    Raises
    ------
    InputError
        For names that are unknown, values out of range, and requirements that make no sense.
    """
    from bywire.api.design import designed_at_point, designed_by_region, requirements_of
    from bywire.api.loop_case import loop_case
    from bywire.core.arguments import whole_number
    from bywire.core.errors import ParameterError

    whole_number("seed", seed, 0, 2**63 - 1)
    if schedule and vary:
        raise ParameterError(
            "schedule and vary exclude each other: gains by region are not chosen for drawn models",
            name="schedule",
        )
    sizes = None if linear_only else amplitudes
    if schedule:
        return designed_by_region(
            loop,
            parameters,
            at,
            overrides,
            requirements_of(requirements, require),
            over,
            sizes,
            free_derivative,
            seed,
            progress,
            side,
        )
    return designed_at_point(
        loop_case(loop, parameters, at, overrides, side),
        overrides,
        requirements_of(requirements, require),
        over,
        sizes,
        free_derivative,
        vary,
        drawn,
        probability,
        seed,
        progress,
    )
