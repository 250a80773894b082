"""What time traces of the brake show."""

from __future__ import annotations

from bywire.report.line_role import Role
from bywire.report.panels import Panel, Panels, Trace

PANELS = Panels(
    "emb-caliper",
    ("emb-caliper",),
    (
        Panel(
            "clamp force",
            (Trace("F_cl"), Trace("F_meas", Role.SECOND), Trace("F_ref", Role.SET_POINT)),
            height=1.8,
        ),
        Panel(
            "motor speed",
            (Trace("omega"), Trace("omega_ref", Role.SET_POINT)),
            saturation="sat_speed",
        ),
        Panel("current", (Trace("i"), Trace("i_ref", Role.SET_POINT)), saturation="sat_current"),
        Panel("torque", (Trace("torque"), Trace("T_fr", Role.SECOND))),
        Panel("power", (Trace("P_el"),)),
    ),
)
