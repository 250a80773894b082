"""Stop of a quarter car in which motor and wedge brake share the demanded moment."""

from __future__ import annotations

from bywire.brakes.wedge.rigs.electric_corner import ElectricCorner, at_speed
from bywire.vehicle.blended_stop import Blended, blended_stop

CORNER_BLENDING = blended_stop(
    "corner-blending",
    Blended(
        ElectricCorner,
        at_speed,
        friction="M_B",
        kinetic=("E_body", "E_wheel"),
        acts="abs",
        demand="M_set",
        changes={"command.mode": "moment", "flywheel.law": "coasting"},
    ),
    {"T_demand": 400.0},
)
