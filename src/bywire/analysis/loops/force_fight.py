"""Position loops of two motors that follow one reference, screws against a force sensor."""

from __future__ import annotations

from bywire.analysis.loop import Loop, Quantity
from bywire.analysis.loops.screw_rig_point import CAUSES, point
from bywire.analysis.loops.wedge_causes import DRIVE_LIMITS

LOOP = Loop(
    name="force-fight",
    assembly="wedge-brake",
    summary="position control of two motors on one reference, a force sensor between, 5 kHz",
    at=Quantity("force", "N", 0.0),
    inputs=("theta_1_set", "theta_2_set"),
    output="theta_2",
    cut="i_2_ref",
    point=point,
    causes=CAUSES,
    band=(1.0, 150.0),
    amplitudes=(1e-3, 0.25, 0.5, 1.0),
    tunables={
        "control.position.f_n": (2.0, 200.0), "control.position.zeta": (0.2, 4.0),
        "control.position.c": (0.0, 1.0),
    },
    proof="force-fight",
    saturations=DRIVE_LIMITS,
    single=False,  # two motors share the load
)
