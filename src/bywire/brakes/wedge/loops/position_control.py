"""What the loops around the wedge brake's position control have in common."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from bywire.analysis.loop import Loop, Point, Quantity
from bywire.brakes.wedge.loops.causes import DRIVE_LIMITS
from bywire.core.parameters import ParameterSet

BAND = (1.0, 150.0)
"""frequencies [Hz]"""

TUNABLES: Mapping[str, tuple[float, float]] = {
    "control.position.f_n": (2.0, 200.0),
    "control.position.zeta": (0.2, 4.0),
    "control.position.c": (0.0, 1.0),
}
"""gains of the law -> lowest and highest worth a try"""


def two_motor_loop(
    name: str,
    summary: str,
    at: Quantity,
    point: Callable[[ParameterSet, float], Point],
    causes: Mapping[str, Mapping[str, Any]],
    proof: str = "",
) -> Loop:
    """Return the position loop of two motors that follow one reference and share a load.

    Parameters
    ----------
    name, summary, at, point, causes, proof
        As those of a `Loop`.
    """
    return Loop(
        name=name,
        assembly="wedge-brake",
        summary=summary,
        at=at,
        inputs=("theta_1_set", "theta_2_set"),
        output="theta_2",
        cut="i_2_ref",
        point=point,
        causes=causes,
        band=BAND,
        amplitudes=(1e-3, 0.25, 0.5, 1.0),
        tunables=TUNABLES,
        proof=proof,
        saturations=DRIVE_LIMITS,
        single=False,  # two motors share the load
    )
