"""Position loop of the assembled wedge: both motors follow one reference."""

from __future__ import annotations

from typing import cast

from bywire.analysis.loop import Point, Quantity
from bywire.brakes.wedge.control import Stimulus
from bywire.brakes.wedge.loops.causes import CAUSES
from bywire.brakes.wedge.loops.position_control import two_motor_loop
from bywire.brakes.wedge.model import WedgeBrake
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.brakes.wedge.start import memory_at, state_at, travel_for
from bywire.core.errors import ParameterError
from bywire.core.parameters import ParameterSet
from bywire.core.signals import zeros


def point(par: ParameterSet, value: float) -> Point:
    """Return the wedge at a travel [m] within the clearance, preloaded between the screws.

    Raises
    ------
    ParameterError
        When the pads would press.
    """
    own = cast(WedgeParameters, par.replace({"command.mode": "position"}))
    free = min(travel_for(0.0, own), own.wedge.x_stop)
    if not abs(value) < free:
        raise ParameterError(
            f"wedge travel = {value * 1e3:g} mm is out of the clearance: it must be between "
            f"{-free * 1e3:.3g} and {free * 1e3:.3g} mm"
        )
    memory = memory_at(value, own)
    stimulus = zeros(Stimulus)._replace(
        theta_1_set=memory.theta_1_ref, theta_2_set=memory.theta_2_ref
    )
    return Point(WedgeBrake(), own, state_at(value, own), memory, stimulus)


LOOP = two_motor_loop(
    name="position",
    summary="position control of the assembled wedge in its clearance, 5 kHz",
    at=Quantity("wedge travel", "m", 0.0),
    point=point,
    causes=CAUSES,
)
