"""The causes of a loop's nonlinearity, one by one."""

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
    str, Ask("Small and large amplitude, e.g. '0.001 rad, 1 rad'.", "Amplitudes")
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
    Command("agreement", status_1="if the causes do not add up"),
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
    """Attribute a loop's nonlinearity to its causes, one by one.

    Parameters
    ----------
    loop, parameters, at, overrides
        See `bywire.margins`.
    frequencies
        Frequencies as ``"1 Hz:150 Hz:20"`` or separated by commas. Default: six over the loop's
        band.
    amplitudes
        Small and large amplitude, ``"0.001 rad, 1 rad"``. Default: those that the loop declares.
    progress
        Called with a label and the finished share, 0 to 1.
    side
        Side of the linear model; see `bywire.margins`.

    Returns
    -------
    LoopAgreement
        Differences between the loop's responses by cause: frequencies in Hz, gains, phases in
        degrees, shares of the difference in percent.

    Raises
    ------
    InputError
        For unknown names, values out of range, parameter sets of another brake, unstable loops.
    """
    from bywire.api.agreement import compared_responses

    return compared_responses(
        *_read(loop, parameters, at, overrides, frequencies, amplitudes, side), progress
    )
