"""Panels of time traces, and sliders of the brake's pages."""

from __future__ import annotations

from bywire.authoring import LineRole, Panel, Panels, Sliders, Trace

_PRESSURE = Panel("pressure", (Trace("p"), Trace("p_ref", LineRole.SET_POINT)), height=1.8)
_OPENING = Panel("opening", (Trace("feed"), Trace("exhaust", LineRole.SECOND)))
_ROD = Panel("rod travel", (Trace("x"),))
_FORCE = Panel("clamp force", (Trace("F_cl"),))
_SPEED = Panel("speed", (Trace("v_x"), Trace("v_tread", LineRole.SECOND)))
_TORQUE = Panel("brake torque", (Trace("torque"),))

PANELS = Panels(
    "truck-ebs",
    ("truck-ebs", "truck-brake-rig"),
    (_PRESSURE, _OPENING, _ROD, _FORCE, _SPEED, _TORQUE),
)
ABS_PANELS = Panels(
    "truck-abs",
    ("truck-abs",),
    (
        _SPEED,
        Panel("slip", (Trace("slip"),)),
        Panel("pressure", (Trace("p"), Trace("p_left", LineRole.SET_POINT)), height=1.8),
        Panel("modulator", (Trace("hold"), Trace("vent", LineRole.SECOND))),
        _TORQUE,
        Panel("air", (Trace("m_fed"), Trace("m_out", LineRole.SECOND))),
    ),
)
PARK_PANELS = Panels(
    "truck-park",
    ("truck-park",),
    (
        Panel("pressure", (Trace("p"), Trace("p_park", LineRole.SECOND)), height=1.8),
        Panel("pressure of the tank", (Trace("p_tank"),)),
        Panel("piston travel", (Trace("x_spring"), Trace("x", LineRole.SECOND))),
        Panel("force of the spring brake", (Trace("F_push"),)),
        _FORCE,
        _TORQUE,
        Panel("distance", (Trace("s"),)),
    ),
)
SLIDERS = Sliders(
    "truck-ebs",
    ("truck-ebs",),
    ("feed.C", "relay.tau", "chamber.V_0", "caliper.clearance", "disc.mu", "ecu.T_bus"),
)
