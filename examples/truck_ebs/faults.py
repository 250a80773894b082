"""Faults of the brake in addition to the faults of its elements."""

from __future__ import annotations

from typing import Any

from bywire.authoring import Channel, Channels


def _reading(value: float, par: Any) -> float:
    return value / float(par.ecu.p_range)


CHANNELS = Channels(
    "truck-ebs",
    (
        Channel("pressure", "pressure sensor", "Pa", "y_p", seen=_reading, stuck=0.0, offset=0.5e5),
        Channel("pilot", "pilot valve", "Pa", "p_control", "drive", stuck=0.0, task="ecu"),
    ),
)
