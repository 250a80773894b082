"""Panels of time traces, and sliders of the brake's pages."""

from __future__ import annotations

from bywire.authoring import LineRole, Panel, Panels, Sliders, Trace

_PLUNGER = Panel(
    "plunger pressure", (Trace("p_mc"), Trace("p_ref", LineRole.SET_POINT)), height=1.8
)
_TRAVEL = Panel("plunger travel", (Trace("x_mc"),))
_CURRENT = Panel(
    "current", (Trace("i"), Trace("i_ref", LineRole.SET_POINT)), saturation="sat_current"
)
PANELS = Panels(
    "one-box",
    ("one-box",),
    (
        _PLUNGER,
        Panel("brake pressures", (Trace("p"), Trace("p_o", LineRole.SECOND))),
        _TRAVEL,
        _CURRENT,
        Panel("pedal travel", (Trace("x_foot"),)),
    ),
)
CORNER_PANELS = Panels(
    "one-box-corner",
    ("one-box-corner",),
    (
        Panel("speed", (Trace("v_x"), Trace("v_tread", LineRole.SECOND)), height=1.8),
        Panel("slip", (Trace("slip"),)),
        Panel(
            "wheel pressure",
            (Trace("p"), Trace("p_hat", LineRole.SECOND), Trace("p_wheel_ref", LineRole.SET_POINT)),
            height=1.8,
        ),
        Panel("valve lift", (Trace("x_in"), Trace("x_out", LineRole.SECOND))),
        Panel("accumulator", (Trace("V_acc"), Trace("V_hat", LineRole.SECOND))),
        _PLUNGER,
        _TRAVEL,
        _CURRENT,
    ),
)
SLIDERS = Sliders(
    "one-box",
    ("one-box", "one-box-corner"),
    (
        "inlet.seat.d",
        "outlet.seat.d",
        "caliper.c",
        "motor.K_e",
        "others.c",
        "ecu.pressure.omega_c",
    ),
)
