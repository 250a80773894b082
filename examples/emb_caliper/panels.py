"""Panels of the brake's time traces, and sliders of its pages."""

from __future__ import annotations

from bywire.authoring import LineRole, Panel, Panels, Sliders, Trace

_FORCE = Panel(
    "clamp force",
    (Trace("F_cl"), Trace("F_meas", LineRole.SECOND), Trace("F_ref", LineRole.SET_POINT)),
    height=1.8,
)
_ESTIMATE = Panel("force error", (Trace("F_error"),))  # in estimated-force only
_SPEED = Panel(
    "motor speed",
    (Trace("omega"), Trace("omega_ref", LineRole.SET_POINT)),
    saturation="sat_speed",
)
_TORQUE = Panel("torque", (Trace("torque"), Trace("T_fr", LineRole.SECOND)))
_POWER = Panel("power", (Trace("P_el"),))

PANELS = Panels(
    "emb-caliper",
    ("emb-caliper",),
    (
        _FORCE,
        _ESTIMATE,
        _SPEED,
        Panel(
            "current", (Trace("i"), Trace("i_ref", LineRole.SET_POINT)), saturation="sat_current"
        ),
        _TORQUE,
        _POWER,
    ),
)
PMSM_PANELS = Panels(
    "emb-caliper-pmsm",
    ("emb-caliper-pmsm",),
    (
        _FORCE,
        _ESTIMATE,
        _SPEED,
        Panel(
            "currents",
            (
                Trace("i_q"),
                Trace("i_q_ref", LineRole.SET_POINT),
                Trace("i_d", LineRole.SECOND),
            ),
            saturation="sat_current",
        ),
        Panel("voltages", (Trace("v_q"), Trace("v_d", LineRole.SECOND)), saturation="sat_duty"),
        _TORQUE,
        _POWER,
    ),
)

PARKING_PANELS = Panels(
    "emb-parking",
    ("emb-parking",),
    (
        Panel("clamp force", (Trace("F_cl"),), height=1.8),
        Panel("disc temperature", (Trace("T_disc"),)),
        Panel("piston travel", (Trace("travel"),)),
        Panel("current", (Trace("i"),)),
        Panel("shaft torque", (Trace("T_fr"), Trace("T_pawl", LineRole.SECOND))),
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
PMSM_SLIDERS = Sliders(
    "emb-caliper-pmsm",
    ("emb-caliper-pmsm",),
    (
        "screw.lead",
        "friction.C",
        "motor.R",
        "motor.psi",
        "caliper.clearance",
        "ecu.current.omega_c",
    ),
)
PARKING_SLIDERS = Sliders(
    "emb-parking",
    ("emb-parking",),
    (
        "screw.mu",
        "screw.lead",
        "disc.length",
        "parking.F_park",
        "parking.F_again",
        "parking.t_again",
    ),
)
