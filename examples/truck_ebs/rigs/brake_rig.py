"""The brake on a rig, at standstill and without a vehicle."""

from __future__ import annotations

from typing import Any, ClassVar

from bywire.authoring import zeros
from truck_ebs import ecu
from truck_ebs.mechanics import AirBrake, released
from truck_ebs.parameters import TruckParameters as Par


class BrakeRig(AirBrake[Par, ecu.Memory]):
    """The brake without its wheel."""

    name: ClassVar[str] = "truck-brake-rig"
    Memory: ClassVar = ecu.Memory
    Stimulus: ClassVar = ecu.Stimulus

    def rest(self, par: Par) -> tuple[Any, ecu.Memory]:
        """Return the released brake."""
        return BrakeRig.state(**released(par)), zeros(ecu.Memory)
