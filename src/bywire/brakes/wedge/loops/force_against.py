"""One motor is shaken against the other, which holds its position: the force sensor answers."""

from __future__ import annotations

from bywire.analysis.loop import Loop, Quantity
from bywire.brakes.wedge.loops.causes import DRIVE_LIMITS, DRIVE_TRAIN
from bywire.brakes.wedge.loops.position_control import BAND, TUNABLES
from bywire.brakes.wedge.loops.screw_rig_point import point

LOOP = Loop(
    name="force-against",
    assembly="wedge-brake",
    summary="force between two motors, one shaken against the other that holds, 5 kHz",
    at=Quantity("force", "N", 0.0),
    inputs=("theta_1_set",),
    output="F",
    cut="i_1_ref",
    point=point,
    causes=DRIVE_TRAIN,
    band=BAND,
    amplitudes=(1e-3, 0.05, 0.1, 0.2),
    tunables=TUNABLES,
    saturations=DRIVE_LIMITS,
    single=False,  # the force answers, the angle is controlled
)
