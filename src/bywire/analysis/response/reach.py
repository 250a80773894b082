"""Whether a sine asks for set points at which the brake cannot rest."""

from __future__ import annotations

from typing import TYPE_CHECKING

from bywire.core.errors import ParameterError
from bywire.core.signals import signals_of

if TYPE_CHECKING:
    from bywire.analysis.loop import Loop
    from bywire.core.parameters import ParameterSet


def leaving(loop: Loop, par: ParameterSet, value: float, amplitude: float) -> str:
    """Return why a sine around an operating point leaves the brake's range; empty where it stays.

    Parameters
    ----------
    loop, par, value
        The loop and its operating point.
    amplitude
        Of the sine [SI unit of the first input].

    Notes
    -----
    Only set points of the quantity that the operating point is given by can be judged: both
    ends of the sine are tried as operating points.
    """
    stimulus = loop.point(par, value).model.Stimulus
    if signals_of(stimulus)[loop.inputs[0]].unit != loop.at.unit:
        return ""
    for end in (value - amplitude, value + amplitude):
        try:
            loop.point(par, end)
        except ParameterError as error:
            return str(error)
    return ""
