"""Faults of the brake in addition to the faults of its elements."""

from __future__ import annotations

from bywire.authoring import Channel, Channels

CHANNELS = Channels(
    "emb-caliper",
    (
        Channel("encoder", "motor encoder", "rad", "theta", offset=0.5),
        Channel("current", "current sensor", "A", "i", offset=1.0),
        Channel("force", "load cell", "N", "F_cell", offset=1e3),
        Channel("bridge", "bridge", "1", "duty", "drive", stuck=1.0, task="current"),
    ),
)
# The encoder has no channel here, because a falsified angle would also turn the measured currents.
# The fault encoder.turned of its element turns only the reading.
PMSM_CHANNELS = Channels(
    "emb-caliper-pmsm",
    (
        Channel("current", "current sensors (q axis)", "A", "i_q", offset=1.0),
        Channel("force", "load cell", "N", "F_cell", offset=1e3),
    ),
)
