"""The hand-written C of a controlled stop of the two-wheeler, ``hand_written_stop.c``."""

from __future__ import annotations

from pathlib import Path

from benchmarks.peers.hand_code import HandCode
from benchmarks.peers.hand_source import Subject
from bywire.brakes.two_wheeler.model import TwoWheelerByWire
from bywire.brakes.two_wheeler.parameters import TwoWheelerParameters
from bywire.simulation.compiler import SINGLE

SUBJECT = Subject(
    folder=Path(__file__).parent,
    source="hand_written_stop.c",
    indices="hand_written_stop_indices.h",
    shared=("hand_written_stop_plant.h", "hand_written_stop_ecu.h"),
    model=TwoWheelerByWire,
    flow=TwoWheelerByWire.Flow,
    choices={
        "vehicle.body.load": ("lagged",),
        "vehicle.front_tyre.curve": ("burckhardt",),
        "vehicle.rear_tyre.curve": ("burckhardt",),
        "front.heat.law": ("off",),
        "rear.heat.law": ("off",),
        "sensors.encoder.law": ("pulses",),
        "ecu.abs": ("pi",),
        "ecu.lift": ("pi",),
        "ecu.sees": ("estimated",),
        "ecu.wheel_speed.law": ("period",),
        "ecu.vehicle_speed.law": ("accelerometer",),
        "ecu.front_slip.schedule": ("speed",),
        "ecu.rear_slip.schedule": ("speed",),
    },
)


class HandWrittenStop(HandCode):
    """The compiled library of the two-wheeler (see ``HandCode``).

    The second counter is the number of substeps that took more than one pass.
    """

    def __init__(self, par: TwoWheelerParameters, flags: tuple[str, ...] = SINGLE) -> None:
        super().__init__(SUBJECT, par, flags)
