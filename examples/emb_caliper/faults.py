"""Faults of the brake in addition to the faults of its elements."""

from __future__ import annotations

from bywire.authoring import Channel, Channels

CHANNELS = Channels(
    "emb-caliper",
    (
        Channel("encoder", "motor encoder", "rad", "theta", offset=0.5),
        Channel("current", "current sensor", "A", "i", offset=1.0),
        Channel("bridge", "bridge", "1", "duty", "drive", stuck=1.0, task="current"),
    ),
)
