"""Closed-loop response by amplitude, including friction, limits and sampling."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any

from bywire.core.libraries import on_one_thread
from bywire.usecases.asks import (
    At,
    Changes,
    ErrorEstimate,
    Frequencies,
    LoopName,
    ParameterSetName,
    Side,
)
from bywire.usecases.declare import NOTHING, Ask, Form, use_case

if TYPE_CHECKING:
    from bywire.api.frequency_response import FrequencyResponse
    from bywire.api.loop_case import LoopCase
    from bywire.core.typing import Progress

_POINTS = 20
_EXCITATIONS = ("sine", "multisine", "chirp")
Amplitudes = Annotated[str, Ask("Amplitudes, e.g. '0.5 rad, 1 rad'.", "Amplitudes")]
Excitation = Annotated[
    str,
    Ask(
        "Excitation: sine (one frequency at a time), multisine or chirp.",
        "Excitation",
        words=_EXCITATIONS,
    ),
]
BandwidthRange = Annotated[
    str, Ask("Range over which to compute bandwidths, e.g. motor.R_m=0.2ohm:0.6ohm:5.", "Range")
]


def _read(
    loop: str,
    parameters: str,
    at: str,
    overrides: Mapping[str, Any],
    frequencies: str,
    amplitudes: str,
    over: str,
    side: str,
) -> "tuple[LoopCase, list[float], list[float], tuple[str, str, list[float]]]":
    from bywire.api.loop_case import loop_case, over_range, spread

    case = loop_case(loop, parameters, at, overrides, side)
    wanted = case.frequencies(frequencies, _POINTS)
    sizes = list(case.loop.amplitudes)
    if amplitudes:
        sizes = spread(amplitudes, case.input_unit, "amplitudes")
    return case, wanted, sizes, over_range(over, case) if over else ("", "1", [])


@use_case("frequency-response", form=Form("Frequency response", "Measure", "loop"), check=_read)
@on_one_thread()
def frequency_response(
    loop: LoopName,
    parameters: ParameterSetName = "",
    at: At = "",
    overrides: Changes = NOTHING,
    *,
    frequencies: Frequencies = "",
    amplitudes: Amplitudes = "",
    excitation: Excitation = "sine",
    over: BandwidthRange = "",
    progress: "Progress | None" = None,
    estimate_error: ErrorEstimate = True,
    side: Side = "",
) -> "FrequencyResponse":
    """Measure a closed loop's response by amplitude, including friction, limits and sampling.

    Parameters
    ----------
    loop, parameters, at, overrides
        See `bywire.margins`.
    frequencies
        Frequencies as ``"1 Hz:150 Hz:20"`` or separated by commas. Default: twenty over the loop's
        band.
    amplitudes
        Amplitudes with units, separated by commas. Default: those that the loop declares.
    excitation
        ``"sine"`` (one frequency at a time), ``"multisine"``, or ``"chirp"``.
    over
        Range of a parameter over which to compute bandwidths, ``"NAME=LOW:HIGH:COUNT"``.
    progress
        Called with a label and the finished share, 0 to 1.
    estimate_error
        Whether to repeat the measurement in half steps. ``data`` then contains the numerical error
        of gain, phase and bandwidths (``NAME_step_error``).
    side
        Side of the linear models; see `bywire.margins`.

    Returns
    -------
    FrequencyResponse
        Gain and phase [degrees] by frequency [Hz] and amplitude [SI], with bandwidths in Hz.

    Raises
    ------
    InputError
        For unknown names, values out of range, parameter sets of another brake, unstable loops.
    """
    from bywire.api.frequency_response import measured_response
    from bywire.core.errors import unknown_name
    from bywire.core.typing import silent

    if excitation not in _EXCITATIONS:
        raise unknown_name("excitation", excitation, _EXCITATIONS)
    case, wanted, sizes, span = _read(
        loop, parameters, at, overrides, frequencies, amplitudes, over, side
    )
    return measured_response(
        case,
        overrides,
        wanted,
        sizes,
        span,
        excitation,
        progress or silent,
        estimate_error=estimate_error,
    )
