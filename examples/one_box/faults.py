"""Faults of the brake in addition to the faults of its elements."""

from __future__ import annotations

from bywire.authoring import Channel, Channels

_COMMON = (
    Channel("pressure", "plunger pressure sensor", "Pa", "p_mc", stuck=20e5, offset=2e5),
    Channel("angle", "motor angle sensor", "rad", "theta", offset=1.0),
    Channel("current", "current sensor", "A", "i", offset=2.0),
    Channel("travel", "travel sensor of the pedal", "m", "x_rod", offset=1e-3),
    Channel("bridge", "bridge", "1", "duty", "drive", stuck=1.0, task="current"),
)
CHANNELS = Channels("one-box", _COMMON)
CORNER_CHANNELS = Channels(
    "one-box-corner",
    (
        *_COMMON,
        Channel("inlet-driver", "inlet valve driver", "1", "close", "drive", task="valves"),
        Channel("outlet-driver", "outlet valve driver", "1", "release", "drive", task="valves"),
        Channel("pump-relay", "relay of the return pump", "1", "pump", "drive", task="valves"),
    ),
)
