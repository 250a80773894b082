"""Design of a loop's gains from requirements."""

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
    Ask("Requirement, e.g. 'bandwidth >= 10 Hz'. Repeatable.", "Requirements"),
]
RequirementsFile = Annotated[str | Path | None, Ask("TOML file with a section [requirements].")]
Ranges = Annotated[
    Sequence[str],
    Ask("Range that the gains must cover, e.g. at=5bar:35bar:7. Repeatable.", "Ranges"),
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
    Ask("Let the derivative filter be faster than the sampling and act on the set point."),
]
DrawnFrom = Annotated[
    str | Path,
    Ask(
        "Study file whose distributions bywire uses to draw models for the design.",
        metavar="FILE",
        is_text=True,
    ),
]
Drawn = Annotated[int, Ask("Number of models to draw for the design.")]
Probability = Annotated[
    str, Ask("Required probability of meeting all requirements, e.g. '99 %'. Needs --vary.")
]
Seed = Annotated[int, Ask("Random seed of the search.", least=0)]


def _read(loop: str, parameters: str, overrides: Mapping[str, Any], side: str) -> None:
    from bywire.api.loop_case import loop_case

    loop_case(loop, parameters, "", overrides, side)


@use_case(
    Command("design", status_1="if they cannot be met"),
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
    """Design a loop's gains from requirements.

    Parameters
    ----------
    loop, parameters, at, overrides
        See `bywire.margins`. A parameter that you set is fixed. With ``schedule``, ``at`` lists
        one point for each region.
    require
        Requirements, for example ``"bandwidth >= 10 Hz"``.
    requirements
        TOML file with a section ``requirements``.
    over
        Ranges that the gains must also cover, each as ``"NAME=LOW:HIGH:COUNT"``.
    amplitudes
        Amplitudes of the bench's sine tests, with units, separated by commas. Default: those that
        the loop declares.
    schedule
        Whether to schedule the gains by region.
    linear_only
        Whether to skip the test on the nonlinear bench.
    free_derivative
        Whether the derivative filter may be faster than the sampling and act on the set point. The
        figures improve, but such gains are rarely suitable for an ECU.
    vary
        Study file. bywire draws models from its distributions, chooses the gains for these models,
        and judges them on additional models.
    drawn
        Number of models to draw for choosing the gains.
    probability
        Required probability of meeting all requirements together, for example ``"99 %"``.
    seed
        Random seed of the search.
    progress
        Called with a label and the finished share, 0 to 1.
    side
        Side of the linear models; see `bywire.margins`.

    Returns
    -------
    LoopDesign or LoopScheduleDesign
        Gains in SI units, the achieved figures, the binding requirement, and the results on the
        nonlinear bench.

    Raises
    ------
    InputError
        For unknown names, values out of range, and invalid requirements.
    """
    from bywire.api.design import designed_at_point, designed_by_region, requirements_of
    from bywire.api.loop_case import loop_case
    from bywire.core.arguments import whole_number
    from bywire.core.errors import ParameterError

    whole_number("seed", seed, 0, 2**63 - 1)
    if schedule and vary:
        raise ParameterError(
            "use either schedule or vary, not both. bywire cannot schedule gains for drawn models",
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
