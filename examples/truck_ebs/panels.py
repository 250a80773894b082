"""Panels of time traces, and sliders of the brake's pages."""

from __future__ import annotations

from bywire.authoring import LineRole, Panel, Panels, Sliders, Trace

PANELS = Panels(
    "truck-ebs",
    ("truck-ebs", "truck-brake-rig"),
    (
        Panel("pressure", (Trace("p"), Trace("p_ref", LineRole.SET_POINT)), height=1.8),
        Panel("opening", (Trace("feed"), Trace("exhaust", LineRole.SECOND))),
        Panel("rod travel", (Trace("x"),)),
        Panel("clamp force", (Trace("F_cl"),)),
        Panel("speed", (Trace("v_x"), Trace("v_tread", LineRole.SECOND))),
        Panel("brake torque", (Trace("torque"),)),
    ),
)
SLIDERS = Sliders(
    "truck-ebs",
    ("truck-ebs",),
    ("feed.C", "relay.tau", "chamber.V_0", "caliper.clearance", "disc.mu", "ecu.T_bus"),
)
