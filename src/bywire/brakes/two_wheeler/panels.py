"""Panels of time traces of the two-wheeler, and sliders of its pages."""

from __future__ import annotations

from bywire.control import abs_rules
from bywire.report.live_page.sliders import Sliders
from bywire.report.panels import Panel, Panels, Role, Trace

_VEHICLE = (
    Panel(
        "speed",
        (Trace("v"), Trace("v_f", Role.SECOND), Trace("v_r", Role.SIMULATED)),
        height=1.8,
    ),
    Panel("slip", (Trace("slip_f"), Trace("slip_r", Role.SECOND)), height=1.4),
    Panel("deceleration", (Trace("a"),)),
    Panel(
        "front pressure",
        (Trace("p_f"), Trace("p_f_ref", Role.SET_POINT)),
        saturation="abs_f",
        saturated="slip control",
    ),
    Panel(
        "rear pressure",
        (Trace("p_r"), Trace("p_r_ref", Role.SET_POINT)),
        saturation="abs_r",
        saturated="slip control",
    ),
    Panel("rules, front", (Trace("phase_f"),), levels=abs_rules.PHASES, height=0.8),
    Panel("rules, rear", (Trace("phase_r"),), levels=abs_rules.PHASES, height=0.8),
    Panel("load", (Trace("N_f"), Trace("N_r", Role.SECOND))),
    Panel("pitch", (Trace("phi"),)),
    Panel("discs", (Trace("T_disc_f"), Trace("T_disc_r", Role.SECOND))),
    Panel("pads", (Trace("T_pads_f"), Trace("T_pads_r", Role.SECOND))),
)
_REAR = (
    Panel(
        "rear cylinder",
        (Trace("rear_p_mc"), Trace("rear_p_pd", Role.SECOND), Trace("rear_p_ref", Role.SET_POINT)),
    ),
    Panel(
        "rear current",
        (Trace("rear_i"), Trace("rear_i_ref", Role.SET_POINT)),
        saturation="rear_sat_current",
    ),
    Panel("rear motor", (Trace("rear_omega"),)),
    Panel("rear power", (Trace("rear_P_el"),)),
    Panel(
        "rear winding",
        (Trace("rear_T_winding"),),
        saturation="rear_derated",
        saturated="derated",
    ),
)

PANELS = Panels("two-wheeler", ("two-wheeler-by-wire",), _VEHICLE)
WHOLE_REAR = Panels("two-wheeler-whole-rear", ("two-wheeler-whole-rear",), (*_VEHICLE, *_REAR))

SLIDERS = Sliders(
    "two-wheeler",
    ("two-wheeler-by-wire", "two-wheeler-whole-rear"),
    (
        "vehicle.road.grip",
        "vehicle.body.m",
        "vehicle.body.h",
        "front.disc.mu_pad",
        "front.circuit.f_n",
        "ecu.front_slip.slip_set",
    ),
)
"""parameters with the most effect on braking, at the top of this vehicle's pages"""
