"""Design of a loop's gains to meet requirements."""

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
    Ask(
        "Requirement, e.g. 'bandwidth >= 10 Hz', or with --vary 'overshoot <= 15 % with 99 %'. "
        "Repeatable.",
        "Requirements",
    ),
]
RequirementsFile = Annotated[str | Path | None, Ask("TOML file with a [requirements] section.")]
Ranges = Annotated[
    Sequence[str],
    Ask("Range over which the gains must work, e.g. at=5bar:35bar:7. Repeatable.", "Ranges"),
]
SineAmplitudes = Annotated[
    str, Ask("Amplitudes of the bench's sine tests, e.g. '1 bar, 3 bar'.", "Amplitudes")
]
Schedule = Annotated[
    bool, Ask("Schedule gains by region. --at lists one point per region.", "Gains by region")
]
LinearOnly = Annotated[bool, Ask("Skip the test on the nonlinear bench.", "Linear only (faster)")]
FreeDerivative = Annotated[
    bool,
    Ask(
        "Allow a derivative filter faster than the sampling, and derivative action on the set "
        "point."
    ),
]
DrawnFrom = Annotated[
    str | Path,
    Ask(
        "Study file with the distributions from which bywire draws models for the design.",
        metavar="FILE",
        is_text=True,
    ),
]
Drawn = Annotated[int, Ask("Number of models to draw for the design.")]
Probability = Annotated[
    str, Ask("Required probability of meeting all requirements, e.g. '99 %'. Requires --vary.")
]
Seed = Annotated[int, Ask("Random seed of the search.", least=0)]


def _read(loop: str, parameters: str, overrides: Mapping[str, Any], side: str) -> None:
    from bywire.api.loop_case import loop_case

    loop_case(loop, parameters, "", overrides, side)


@use_case(
    Command("design", status_1="if the requirements cannot be met"),
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
    """Design a loop's gains to meet requirements.

    Parameters
    ----------
    loop, parameters, at, overrides
        See `bywire.margins`. The design does not change a parameter that you set. With
        ``schedule``, ``at`` lists one point for each region.
    require
        Requirements, for example ``"bandwidth >= 10 Hz"``. With ``vary``, a requirement may end
        with its probability, for example ``"overshoot <= 15 % with 99 %"``.
    requirements
        TOML file with a ``[requirements]`` section.
    over
        Ranges over which the gains must also work, each as ``"NAME=LOW:HIGH:COUNT"``.
    amplitudes
        Amplitudes of the bench's sine tests, with units, separated by commas. Default: those that
        the loop declares.
    schedule
        Whether to schedule the gains by region.
    linear_only
        Whether to skip the test on the nonlinear bench, also over the distributions of ``vary``.
    free_derivative
        Whether the derivative filter may be faster than the sampling, and the derivative may act on
        the set point. This improves the figures, but such gains are rarely suitable for an ECU.
    vary
        Study file. bywire draws models from its distributions, chooses the gains for these models,
        and tests the gains on additional models. If requirements have probabilities, it also tests
        the gains on the nonlinear bench with these distributions.
    drawn
        Number of models that bywire draws to choose the gains.
    probability
        Required probability that all requirements are met together, for example ``"99 %"``.
    seed
        Random seed of the search.
    progress
        Called with a label and the completed fraction, 0 to 1.
    side
        Side of the linear models (see `bywire.margins`).

    Returns
    -------
    LoopDesign or LoopScheduleDesign
        Gains in SI units, the achieved figures, the binding requirement, and the results on the
        nonlinear bench.

    Raises
    ------
    InputError
        If a name is unknown, a value is out of range, or a requirement is invalid.
    """
    from bywire.api.design import designed_at_point, designed_by_region, requirements_of
    from bywire.api.loop_case import loop_case
    from bywire.core.arguments import whole_number
    from bywire.core.errors import ParameterError

    whole_number("seed", seed, 0, 2**63 - 1)
    if schedule and vary:
        raise ParameterError(
            "schedule and vary cannot be combined, because bywire cannot schedule gains for drawn "
            "models. Use only one of them",
            name="schedule",
            value="True",
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
