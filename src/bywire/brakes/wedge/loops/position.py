"""Position loop of the assembled wedge, and what all loops around position control share."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, cast

from bywire.analysis.loop import Loop, Point, Quantity
from bywire.brakes.wedge.loops.causes import CAUSES, DRIVE_LIMITS
from bywire.brakes.wedge.model import WedgeBrake, state_at
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.brakes.wedge.start import memory_at, travel_for
from bywire.core.errors import ParameterError
from bywire.core.parameters import ParameterSet
from bywire.core.signals import zeros

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

    ``name``, ``summary``, ``at``, ``point``, ``causes``, ``proof``: as those of a `Loop`.
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


def point(par: ParameterSet, value: float) -> Point:
    """Return the wedge at a travel [m] within the clearance, preloaded between the screws.

    Raises
    ------
    ParameterError
        When the pads would press.
    """
    closed = cast(WedgeParameters, par.replace({"command.mode": "position"}))
    free = min(travel_for(0.0, closed), closed.wedge.x_stop)
    if not abs(value) < free:
        raise ParameterError(
            f"wedge travel = {value * 1e3:g} mm is out of the clearance: it must be between "
            f"{-free * 1e3:.3g} and {free * 1e3:.3g} mm"
        )
    memory = memory_at(value, closed)
    stimulus = zeros(WedgeBrake.Stimulus)._replace(
        theta_1_set=memory.theta_1_ref, theta_2_set=memory.theta_2_ref
    )
    return Point(WedgeBrake(), closed, state_at(value, closed), memory, stimulus)


LOOP = two_motor_loop(
    name="position",
    summary="position control of the assembled wedge in its clearance, 5 kHz",
    at=Quantity("wedge travel", "m", 0.0),
    point=point,
    causes=CAUSES,
)
