"""Control loops: margins, linear models, responses by amplitude, causes of nonlinearity."""

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
from bywire.usecases.declare import NOTHING, Ask, Command, Form, use_case

if TYPE_CHECKING:
    from bywire.api.agreement import LoopAgreement
    from bywire.api.frequency_response import FrequencyResponse
    from bywire.api.linearize import LinearizedLoop, LinearizedPlant, PlantCase, PlantLocus
    from bywire.api.loop_case import LoopCase
    from bywire.api.margins import Margins
    from bywire.core.typing import Progress

Over = Annotated[str, Ask("Range, e.g. motor.R_m=0.2ohm:0.6ohm:9 or at=5bar:35bar:7.", "Range")]


def _margins_case(
    loop: str, parameters: str, at: str, overrides: Mapping[str, Any], over: str, side: str
) -> "tuple[LoopCase, tuple[str, str, list[float]]]":
    from bywire.api.loop_case import loop_case, over_range

    case = loop_case(loop, parameters, at, overrides, side)
    return case, over_range(over, case) if over else ("", "1", [])


@use_case("margins", form=Form("Margins of a loop", "Compute", "loop"), check=_margins_case)
def margins(
    loop: LoopName,
    parameters: ParameterSetName = "",
    at: At = "",
    overrides: Changes = NOTHING,
    over: Over = "",
    *,
    side: Side = "",
) -> "Margins":
    """Compute a sampled loop's margins and bandwidth, and their worst case over a range.

    Parameters
    ----------
    loop
        Name of the loop.
    parameters
        Parameter set. Default: the main set of the loop's brake.
    at
        Operating point with its unit, for example ``"20 bar"``. Default: the loop's nominal point.
    overrides
        Changes to parameters by dotted name, as SI numbers or strings with units.
    over
        Range, for example ``"motor.R_m=0.2 ohm:0.6 ohm:9"`` or ``"at=5 bar:35 bar:7"``.
    side
        Side to use if the operating point lies on a kink: ``"above"``, ``"below"``, or
        ``"FILE:LINE=above"`` for single operations, separated by commas. Without a side, bywire
        rejects the point if the linear models on the two sides differ.

    Returns
    -------
    Margins
        Gain margins as factors, phase margin in degrees, crossover frequency and bandwidth in Hz,
        and delay margin in s, at the operating point or at each value of the range, with the worst
        case.

    Raises
    ------
    InputError
        If a name is unknown, a value is out of range, or the parameter set is for another brake.

    Examples
    --------
    >>> import bywire
    >>> found = bywire.margins("pressure", at="20 bar")
    >>> round(found.margins[0].phase)  # degree
    76
    """
    from bywire.api.margins import Margins, margins_over

    case, (name, unit, values) = _margins_case(loop, parameters, at, overrides, over, side)
    return Margins(case, margins_over(case, name, unit, values), name, unit, tuple(values))


# --- Exact linear models of sampled loops and of plants

LoopOrPlant = Annotated[
    str, Ask("Loop or plant (see 'bywire list').", "Loop", name="loop", known=("loops", "plants"))
]
LocusRange = Annotated[
    str, Ask("Parameter range of a root locus, e.g. motor.R_m=0.1ohm:1ohm:71.", "Root locus")
]
Reduce = Annotated[
    str, Ask("Order (e.g. 4) or frequency band (e.g. '150 Hz') of a reduced model.", "Reduce")
]
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


def _linear_case(
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
    check=_linear_case,
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
    """Derive the exact linear model of a sampled closed loop or a plant.

    Parameters
    ----------
    name
        Name of a loop or a plant.
    parameters
        Parameter set. Default: the main set of the loop's or plant's brake.
    at
        Operating point with its unit, for example ``"20 bar"``. Default: the loop's nominal point.
    overrides
        Changes to parameters by dotted name, as SI numbers or strings with units.
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
        The linear model in SI units, with its poles in 1/s. For a range, only the poles.

    Raises
    ------
    InputError
        If a name is unknown, a value is out of range, or options are incompatible.
    SolverError
        If the motion under dither does not become periodic.
    """
    from bywire.api.linearize import linearized

    case = _linear_case(name, parameters, at, overrides, locus, friction, speed, side)
    return linearized(case, locus, reduce, dither)


# --- A closed loop's response by amplitude, including friction, limits and sampling

_RESPONSE_POINTS = 20
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


def _response_case(
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
    wanted = case.frequencies(frequencies, _RESPONSE_POINTS)
    sizes = list(case.loop.amplitudes)
    if amplitudes:
        sizes = spread(amplitudes, case.input_unit, "amplitudes")
    return case, wanted, sizes, over_range(over, case) if over else ("", "1", [])


@use_case(
    "frequency-response", form=Form("Frequency response", "Measure", "loop"), check=_response_case
)
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
    """Measure a closed loop's frequency response per amplitude, with friction, limits and sampling.

    Parameters
    ----------
    loop, parameters, at, overrides
        See `bywire.margins`.
    frequencies
        Frequencies as ``"1 Hz:150 Hz:20"`` or separated by commas. Default: 20 frequencies over the
        loop's band.
    amplitudes
        Amplitudes with units, separated by commas. Default: those that the loop declares.
    excitation
        ``"sine"`` (one frequency at a time), ``"multisine"``, or ``"chirp"``.
    over
        Range of a parameter over which to compute bandwidths, ``"NAME=LOW:HIGH:COUNT"``.
    progress
        Called with a label and the completed fraction, 0 to 1.
    estimate_error
        Whether to repeat the measurement with half the step size. ``data`` then contains the
        numerical error of gain, phase and bandwidths (``NAME_step_error``).
    side
        Side of the linear models (see `bywire.margins`).

    Returns
    -------
    FrequencyResponse
        Gain and phase [degrees] by frequency [Hz] and amplitude [SI], with bandwidths in Hz.

    Raises
    ------
    InputError
        If a name is unknown, a value is out of range, the parameter set is for another brake, or
        the loop is unstable.
    """
    from bywire.api.frequency_response import measured_response
    from bywire.core.errors import unknown_name
    from bywire.core.typing import silent

    if excitation not in _EXCITATIONS:
        raise unknown_name("excitation", excitation, _EXCITATIONS)
    case, wanted, sizes, span = _response_case(
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


# --- The causes of a loop's nonlinearity, one at a time

_AGREEMENT_POINTS = 6
TwoAmplitudes = Annotated[
    str, Ask("Small and large amplitudes, e.g. '0.001 rad, 1 rad'.", "Amplitudes")
]


def _agreement_case(
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
    return case, case.frequencies(frequencies, _AGREEMENT_POINTS), sizes


@use_case(
    Command("agreement", status_1="if the contributions of the causes do not add up"),
    form=Form("Nonlinearity of a loop", "Measure", "loop"),
    check=_agreement_case,
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
    """Attribute a loop's nonlinearity to its causes, one at a time.

    Parameters
    ----------
    loop, parameters, at, overrides
        See `bywire.margins`.
    frequencies
        Frequencies as ``"1 Hz:150 Hz:20"`` or separated by commas. Default: six frequencies over
        the loop's band.
    amplitudes
        Small and large amplitude, such as ``"0.001 rad, 1 rad"``. Default: those that the loop
        declares.
    progress
        Called with a label and the completed fraction, 0 to 1.
    side
        Side of the linear model (see `bywire.margins`).

    Returns
    -------
    LoopAgreement
        Differences between the loop's responses by cause: frequencies in Hz, gains, phases in
        degrees, and contributions to the difference in percent.

    Raises
    ------
    InputError
        If a name is unknown, a value is out of range, the parameter set is for another brake, or
        the loop is unstable.
    """
    from bywire.api.agreement import compared_responses

    return compared_responses(
        *_agreement_case(loop, parameters, at, overrides, frequencies, amplitudes, side), progress
    )
