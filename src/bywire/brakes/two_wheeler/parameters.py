"""Parameters of the vehicle, of its two brakes, and of its ECU."""

from __future__ import annotations

from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Duration
from bywire.plant import brake_disc, pressure_loop
from bywire.vehicle.two_wheeler import VehicleParameters


class BrakeParameters(ParameterSet):
    """One brake: the loop of its pressure, and its discs."""

    circuit: pressure_loop.Parameters
    disc: brake_disc.Parameters


class EcuParameters(ParameterSet):
    """What runs on the ECU."""

    T_s: Duration
    """sample time"""


class TwoWheelerParameters(ParameterSet):
    """The whole vehicle."""

    vehicle: VehicleParameters
    front: BrakeParameters
    rear: BrakeParameters
    ecu: EcuParameters
