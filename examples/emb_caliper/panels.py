"""Panels of the brake's time traces, and sliders of its pages."""

from __future__ import annotations

from bywire.authoring import LineRole, Panel, Panels, Sliders, Trace

PANELS = Panels(
    "emb-caliper",
    ("emb-caliper",),
    (
        Panel(
            "clamp force",
            (Trace("F_cl"), Trace("F_meas", LineRole.SECOND), Trace("F_ref", LineRole.SET_POINT)),
            height=1.8,
        ),
        Panel(
            "motor speed",
            (Trace("omega"), Trace("omega_ref", LineRole.SET_POINT)),
            saturation="sat_speed",
        ),
        Panel(
            "current", (Trace("i"), Trace("i_ref", LineRole.SET_POINT)), saturation="sat_current"
        ),
        Panel("torque", (Trace("torque"), Trace("T_fr", LineRole.SECOND))),
        Panel("power", (Trace("P_el"),)),
    ),
)

SLIDERS = Sliders(
    "emb-caliper",
    ("emb-caliper",),
    (
        "screw.lead",
        "friction.C",
        "motor.R_m",
        "caliper.k_1",
        "caliper.clearance",
        "ecu.force.k_p",
    ),
)
"""parameters with the most effect on braking, at the top of this brake's pages"""
