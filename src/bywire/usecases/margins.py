"""Margins and bandwidth of a sampled loop at an operating point or over a range."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any

from bywire.usecases.asks import At, Changes, LoopName, ParameterSetName, Side
from bywire.usecases.declare import NOTHING, Ask, Form, use_case

if TYPE_CHECKING:
    from bywire.api.loop_case import LoopCase
    from bywire.api.margins import Margins

Over = Annotated[str, Ask("Range, e.g. motor.R_m=0.2ohm:0.6ohm:9 or at=5bar:35bar:7.", "Range")]


def _read(
    loop: str, parameters: str, at: str, overrides: Mapping[str, Any], over: str, side: str
) -> "tuple[LoopCase, tuple[str, str, list[float]]]":
    from bywire.api.loop_case import loop_case, over_range

    case = loop_case(loop, parameters, at, overrides, side)
    return case, over_range(over, case) if over else ("", "1", [])


@use_case("margins", form=Form("Margins of a loop", "Compute", "loop"), check=_read)
def margins(
    loop: LoopName,
    parameters: ParameterSetName = "",
    at: At = "",
    overrides: Changes = NOTHING,
    over: Over = "",
    *,
    side: Side = "",
) -> "Margins":
    """Compute a sampled loop's margins and bandwidth, and the worst case over a range.

    Parameters
    ----------
    loop
        Name of the loop.
    parameters
        Parameter set. Default: the main one of the loop's brake.
    at
        Operating point with its unit, for instance ``"20 bar"``. Default: the loop's nominal point.
    overrides
        Changes of parameters by dotted name, as SI numbers or texts with units.
    over
        Range, for instance ``"motor.R_m=0.2 ohm:0.6 ohm:9"`` or ``"at=5 bar:35 bar:7"``.
    side
        Side of a kink to use if the operating point lies on one: ``"above"``, ``"below"``, or
        ``"FILE:LINE=above"`` for single operations, separated by commas. Without a side, bywire
        rejects such a point if the linear models of both sides differ.

    Returns
    -------
    Margins
        Gain margins as factors, phase margin in degrees, crossover and bandwidth in Hz, delay
        margin in s, at the operating point or at each value of the range, with the worst case.

    Raises
    ------
    InputError
        For unknown names, values out of range, and parameter sets of another brake.

    Examples
    --------
    >>> import bywire
    >>> found = bywire.margins("pressure", at="20 bar")
    >>> round(found.margins[0].phase)  # degree
    76
    """
    from bywire.api.margins import Margins, margins_over

    case, (name, unit, values) = _read(loop, parameters, at, overrides, over, side)
    return Margins(case, margins_over(case, name, unit, values), name, unit, tuple(values))
