"""Position loop of a single motor that drives a preloaded screw (Roberts 2003, Figs. 5 and 6)."""

from __future__ import annotations

from typing import cast

from bywire.analysis.loop import Loop, Point, Quantity
from bywire.brakes.wedge.loops.causes import DRIVE_TRAIN
from bywire.brakes.wedge.loops.position import BAND, TUNABLES
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.brakes.wedge.rigs.shaft_rig import ShaftRig
from bywire.core.parameters import ParameterSet
from bywire.core.signals import zeros

CAUSES = {**DRIVE_TRAIN, "cogging": {"motor_1.T_cog": 0.0}}  # the one motor that there is


def point(par: ParameterSet, value: float) -> Point:
    """Return the shaft at rest at an angle [rad]."""
    rig = cast(
        WedgeParameters,
        par.replace({"rig.mode_1": "position", "rig.load": "screw", "rig.clamp": "open"}),
    )
    state = zeros(ShaftRig.State)._replace(theta_1=value)
    memory = zeros(ShaftRig.Memory)._replace(theta_1_ref=value, last_1=value)
    return Point(
        ShaftRig(), rig, state, memory, zeros(ShaftRig.Stimulus)._replace(theta_1_set=value)
    )


LOOP = Loop(
    name="screw-position",
    assembly="wedge-brake",
    summary="position control of one motor on a preloaded screw, 5 kHz (Figs. 5 and 6)",
    at=Quantity("motor angle", "rad", 0.0),
    inputs=("theta_1_set",),
    output="theta_1",
    cut="i_1_ref",
    point=point,
    causes=CAUSES,
    band=BAND,
    amplitudes=(1e-3, 0.25, 0.5, 1.0, 2.0),
    tunables=TUNABLES,
    proof="screw-position",
)
