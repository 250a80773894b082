"""One motor is shaken against the other, which holds its position: the force sensor answers."""

from __future__ import annotations

from bywire.analysis.loop import Loop, Quantity
from bywire.analysis.loops.screw_rig_point import CAUSES, point
from bywire.analysis.loops.wedge_causes import DRIVE_LIMITS

LOOP = Loop(
    name="force-against",
    assembly="wedge-brake",
    summary="force between two motors, one shaken against the other that holds, 5 kHz",
    at=Quantity("force", "N", 0.0),
    inputs=("theta_1_set",),
    output="F",
    cut="i_1_ref",
    point=point,
    causes=CAUSES,
    band=(1.0, 150.0),
    amplitudes=(1e-3, 0.05, 0.1, 0.2),
    tunables={
        "control.position.f_n": (2.0, 200.0), "control.position.zeta": (0.2, 4.0),
        "control.position.c": (0.0, 1.0),
    },
    saturations=DRIVE_LIMITS,
    single=False,  # the force answers, the angle is controlled
)
