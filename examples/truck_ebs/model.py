"""The brake at a wheel, with a reservoir at constant pressure."""

from __future__ import annotations

from typing import Any, ClassVar

from bywire.authoring import zeros
from truck_ebs import ecu
from truck_ebs.mechanics import BrakedWheel, rolling_brake
from truck_ebs.parameters import TruckParameters as Par


class TruckEbs(BrakedWheel[Par, ecu.Memory]):
    """The brake at a wheel, with a reservoir at constant pressure."""

    name: ClassVar[str] = "truck-ebs"
    Memory: ClassVar = ecu.Memory
    Stimulus: ClassVar = ecu.Stimulus

    def rest(self, par: Par) -> tuple[Any, ecu.Memory]:
        """Return the vehicle at rest with released brakes."""
        return rolling(par, 0.0)


def rolling(par: Par, v: float) -> tuple[Any, ecu.Memory]:
    """Return state and memory of a vehicle that rolls at a speed [m/s] with released brakes."""
    return TruckEbs.state(**rolling_brake(par, v)), zeros(ecu.Memory)
