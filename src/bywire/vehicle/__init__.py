"""Vehicles with any brake: bodies, slip control, ideal stops, and animations."""

from bywire.vehicle.corner import (
    Corner,
    CornerParameters,
    HotCorner,
    HotCornerParameters,
    WheelSpeed,
    rolling_states,
    warm_disc,
)
from bywire.vehicle.ideal_stop import ideal_corner_distance
from bywire.vehicle.two_wheeler import (
    HotBrakes,
    TwoWheeler,
    VehicleParameters,
    cold_start,
    rolling_start,
)

__all__ = [
    "Corner",
    "CornerParameters",
    "HotBrakes",
    "HotCorner",
    "HotCornerParameters",
    "TwoWheeler",
    "VehicleParameters",
    "WheelSpeed",
    "cold_start",
    "ideal_corner_distance",
    "rolling_start",
    "rolling_states",
    "warm_disc",
]
