"""Failures of the two-wheeler in addition to those of its elements.

A whole rear brake adds its declared failures with its path as a prefix.
"""

from __future__ import annotations

from bywire.brakes.two_wheeler.model import TwoWheelerByWire
from bywire.brakes.two_wheeler.rigs.whole_rear import TwoWheelerWholeRear
from bywire.core.faults import Channel, Channels, Fault

NAME = TwoWheelerByWire.name
WHOLE_REAR = TwoWheelerWholeRear.name

_VEHICLE = (
    Channel("encoder_f", "front wheel encoder", "rad", "theta_f", offset=0.1),
    Channel("encoder_r", "rear wheel encoder", "rad", "theta_r", offset=0.1),
    Channel("front", "front brake demand", "Pa", "p_f_ref", "drive", task="ecu"),
)
CHANNELS = (
    Channels(
        NAME,
        (*_VEHICLE, Channel("rear", "rear brake demand", "Pa", "p_r_ref", "drive", task="ecu")),
    ),
    Channels(WHOLE_REAR, _VEHICLE),
)

FAULTS = (
    Fault(
        "accelerometer.offset",
        "the accelerometer measures too much deceleration",
        lambda par, value: {"sensors.a_offset": value},
        (NAME, WHOLE_REAR),
        "m/s**2",
        1.0,
    ),
)
