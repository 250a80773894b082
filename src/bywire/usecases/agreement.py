"""What makes a loop nonlinear, cause by cause."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any

from bywire.usecases.asks import At, Changes, Frequencies, LoopName, ParameterSetName, Side
from bywire.usecases.declare import NOTHING, Ask, Command, Form, use_case

if TYPE_CHECKING:
    from bywire.api.agreement import LoopAgreement
    from bywire.api.loop_case import LoopCase
    from bywire.core.typing import Progress

_POINTS = 6
TwoAmplitudes = Annotated[
    str, Ask("A small and a large amplitude, e.g. '0.001 rad, 1 rad'.", "Amplitudes")
]


def _read(
    loop: str,
    parameters: str,
    at: str,
    overrides: Mapping[str, Any],
    frequencies: str,
    amplitudes: str,
    side: str,
) -> "tuple[LoopCase, list[float], tuple[float, float]]":
    from bywire.api.agreement import two_amplitudes
    from bywire.api.loop_case import loop_case

    case = loop_case(loop, parameters, at, overrides, side)
    sizes = two_amplitudes(case, amplitudes)
    return case, case.frequencies(frequencies, _POINTS), sizes


@use_case(
    Command("agreement", status_1="when it does not add up"),
    form=Form("Nonlinearity of a loop", "Measure", "loop"),
    check=_read,
)
def agreement(
    loop: LoopName,
    parameters: ParameterSetName = "",
    at: At = "",
    overrides: Changes = NOTHING,
    *,
    frequencies: Frequencies = "",
    amplitudes: TwoAmplitudes = "",
    progress: "Progress | None" = None,
    side: Side = "",
) -> "LoopAgreement":
    """Show what makes a loop nonlinear, cause by cause.

    Parameters
    ----------
    loop, parameters, at, overrides
        As of `bywire.margins`.
    frequencies
        ``"1 Hz:150 Hz:20"``, or a list with commas; six over the loop's band by default.
    amplitudes
        A small and a large one, ``"0.001 rad, 1 rad"``; the loop's own by default.
    progress
        Called with a label and the finished share, 0 to 1.
    side
        Of the linear model, as of `bywire.margins`.

    Returns
    -------
    LoopAgreement
        What the loop's responses differ by, cause by cause: frequencies in Hz, gains and phases in
        degree, shares of the difference in percent.

    Raises
    ------
    InputError
        For names that are unknown, values out of range, sets of another brake, unstable loops.
    """
    from bywire.api.agreement import compared_responses

    return compared_responses(
        *_read(loop, parameters, at, overrides, frequencies, amplitudes, side), progress
    )
