"""Panels of the motorcycle brake's time traces, and sliders of its pages."""

from __future__ import annotations

from bywire.report.live_page.sliders import Sliders
from bywire.report.panels import Panel, Panels, Role, Trace

PANELS = Panels(
    "motorcycle",
    ("motorcycle-brake",),
    (
        Panel(
            "pressure",
            (Trace("p_mc"), Trace("p_pd", Role.SECOND), Trace("p_ref", Role.SET_POINT)),
            height=1.8,
        ),
        Panel("current", (Trace("i"), Trace("i_ref", Role.SET_POINT)), saturation="sat_current"),
        Panel("speed", (Trace("omega"),)),
        Panel("duty cycle", (Trace("duty"),), saturation="sat_duty"),
        Panel("power", (Trace("P_el"),)),
        Panel("winding", (Trace("T_winding"),), saturation="derated", saturated="derated"),
    ),
)

SLIDERS = Sliders(
    "motorcycle",
    ("motorcycle-brake",),
    (
        "seal.T_pr",
        "motor.R_m",
        "caliper.K_pd",
        "fluid.beta",
        "ecu.pressure.k_p",
        "ecu.dither.gain",
    ),
)
"""parameters with the most effect on braking, at the top of this brake's pages"""
