"""What makes the loops of the wedge brake nonlinear: causes to switch off, limits to report."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from bywire.analysis.loop import Saturation

Causes = Mapping[str, Mapping[str, Any]]

_SCREWS: Causes = {
    "bearing friction": {
        "bearing.C_0": 0.0,
        "bearing.C_1": 0.0,
        "bearing.C_2": 0.0,
        "bearing.T_nu": 0.0,
    },
    "screw efficiency": {"screw.eta_f": 1.0, "screw.eta_b": 1.0},
}
_MOTORS: Causes = {
    "cogging": {"motor_1.T_cog": 0.0, "motor_2.T_cog": 0.0},
    "encoder": {"encoder.law": "ideal"},
}

DRIVE_TRAIN: Causes = {**_SCREWS, **_MOTORS}
"""cause -> parameters without it: motors and screws on a rig"""

CAUSES: Causes = {
    **_SCREWS,
    "wedge friction": {"wedge_friction.mu_int": 0.0, "wedge_friction.mu_R": 0.0},
    **_MOTORS,
    "run-out, disc slowing": {"flywheel.runout": 0.0, "flywheel.law": "driven"},
}
"""the same of the whole brake"""

DRIVE_LIMITS = (
    Saturation("sat_current", ("i_1_ref", "i_2_ref"), ("control.position.i_max", "drive.i_max")),
)
"""current demand of a drive at the controller's or at its own limit"""
