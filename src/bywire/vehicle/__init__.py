"""Vehicles around any brake: what they share, and what is said of their stops."""

from bywire.vehicle.corner import Corner, CornerParameters
from bywire.vehicle.two_wheeler import TwoWheeler, VehicleParameters, rolling_start

__all__ = ["Corner", "CornerParameters", "TwoWheeler", "VehicleParameters", "rolling_start"]
