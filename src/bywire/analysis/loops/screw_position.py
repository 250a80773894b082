"""Position loop of a single motor that drives a preloaded screw (Roberts 2003, Figs. 5 and 6)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, cast

from bywire.analysis.loop import Loop, Point, Quantity
from bywire.assemblies.shaft_rig import ShaftRig
from bywire.assemblies.shaft_rig_plant import Memory, State, Stimulus
from bywire.assemblies.wedge_parameters import WedgeParameters
from bywire.core.parameters import ParameterSet
from bywire.core.signals import zeros

CAUSES: Mapping[str, Mapping[str, Any]] = {
    "bearing friction": {"bearing.C_0": 0.0, "bearing.C_1": 0.0, "bearing.C_2": 0.0,
                         "bearing.T_nu": 0.0},
    "screw efficiency": {"screw.eta_f": 1.0, "screw.eta_b": 1.0},
    "cogging": {"motor_1.T_cog": 0.0},
    "encoder": {"encoder.law": "ideal"},
}  # fmt: skip


def point(par: ParameterSet, value: float) -> Point:
    """Return the shaft at rest at an angle [rad]."""
    own = cast(
        WedgeParameters,
        par.replace({"rig.mode_1": "position", "rig.load": "screw", "rig.clamp": "open"}),
    )
    state = zeros(State)._replace(theta_1=value)
    memory = zeros(Memory)._replace(theta_1_ref=value, last_1=value)
    return Point(ShaftRig(), own, state, memory, zeros(Stimulus)._replace(theta_1_set=value))


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
    band=(1.0, 150.0),
    amplitudes=(1e-3, 0.25, 0.5, 1.0, 2.0),
    tunables={
        "control.position.f_n": (2.0, 200.0), "control.position.zeta": (0.2, 4.0),
        "control.position.c": (0.0, 1.0),
    },
    proof="screw-position",
)
