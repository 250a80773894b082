"""Faults of the brake in addition to the faults of its elements."""

from __future__ import annotations

from bywire.authoring import Channel, Channels

CHANNELS = Channels(
    "truck-ebs",
    (Channel("pilot", "pilot valve", "Pa", "p_control", "drive", stuck=0.0, task="ecu"),),
)
