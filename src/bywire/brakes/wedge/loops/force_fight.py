"""Position loops of two motors that follow one reference, screws against a force sensor."""

from __future__ import annotations

from bywire.analysis.loop import Quantity
from bywire.brakes.wedge.loops.causes import DRIVE_TRAIN
from bywire.brakes.wedge.loops.position_control import two_motor_loop
from bywire.brakes.wedge.loops.screw_rig_point import point

LOOP = two_motor_loop(
    name="force-fight",
    summary="position control of two motors on one reference, a force sensor between, 5 kHz",
    at=Quantity("force", "N", 0.0),
    point=point,
    causes=DRIVE_TRAIN,
    proof="force-fight",
)
