"""Vehicles with any brake: bodies, slip control, ideal stops, and animations."""

from bywire.vehicle import regeneration
from bywire.vehicle.blended_stop import Blended, blended_stop
from bywire.vehicle.corner import (
    Corner,
    CornerParameters,
    HotCorner,
    HotCornerParameters,
    WheelSpeed,
    rolling_states,
    warm_disc,
)
from bywire.vehicle.ideal_stop import RidingSpeed, ideal_corner_distance
from bywire.vehicle.regeneration import RegeneratingCorner, RegeneratingTwoWheeler
from bywire.vehicle.two_wheeler import (
    HotBrakes,
    TwoWheeler,
    VehicleParameters,
    cold_start,
    rolling_start,
    vehicle_sink,
)

__all__ = [
    "Blended",
    "Corner",
    "CornerParameters",
    "HotBrakes",
    "HotCorner",
    "HotCornerParameters",
    "RegeneratingCorner",
    "RegeneratingTwoWheeler",
    "RidingSpeed",
    "TwoWheeler",
    "VehicleParameters",
    "WheelSpeed",
    "blended_stop",
    "cold_start",
    "ideal_corner_distance",
    "regeneration",
    "rolling_start",
    "rolling_states",
    "vehicle_sink",
    "warm_disc",
]
