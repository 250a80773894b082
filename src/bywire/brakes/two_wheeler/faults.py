"""What may fail on the two-wheeler beside what its elements say."""

from __future__ import annotations

from bywire.brakes.two_wheeler.model import TwoWheelerByWire
from bywire.core.faults import Channel, Channels, Fault

NAME = TwoWheelerByWire.name

CHANNELS = Channels(
    NAME,
    (
        Channel("encoder_f", "front wheel's encoder", "rad", "theta_f", offset=0.1),
        Channel("encoder_r", "rear wheel's encoder", "rad", "theta_r", offset=0.1),
        Channel("front", "front brake", "Pa", "p_f_ref", "drive", task="ecu"),
        Channel("rear", "rear brake", "Pa", "p_r_ref", "drive", task="ecu"),
    ),
)

FAULTS = (
    Fault("accelerometer.offset", "the accelerometer shows too much deceleration",
          lambda par, value: {"sensors.a_offset": value}, NAME, "m/s**2", 1.0),
)  # fmt: skip
