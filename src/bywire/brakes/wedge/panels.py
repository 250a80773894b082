"""Panels and sliders of the wedge brake and its rigs, and signals that runs compare."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType

from bywire.report.live_page.sliders import Sliders
from bywire.report.panels import Panel, Panels, Role, Trace

_WINDINGS = Panel(
    "windings",
    (Trace("T_winding_1"), Trace("T_winding_2", Role.SECOND)),
    saturation="derated",
    saturated="derated",
)
_MODE = Panel("mode", (Trace("mode"),), levels=("parked", "gap", "moment", "retracting"))
_ADJUSTER = (
    Panel("gap", (Trace("gap_hat"), Trace("taken", Role.SECOND))),
    Panel("teeth", (Trace("clicks"),)),
    Panel("adjuster", (Trace("adjusting"),), levels=("waits", "applied", "turns")),
)

BRAKING = Panels(
    "wedge",
    ("wedge-brake",),
    (
        Panel(
            "moment",
            (Trace("y_M"), Trace("M_B", Role.SECOND), Trace("M_set", Role.SET_POINT)),
            height=1.8,
        ),
        Panel(
            "motor speed",
            (Trace("omega_1"), Trace("omega_2", Role.SECOND)),
            saturation="sat_rate",
            saturated="at the software rate limit",
        ),
        Panel("current", (Trace("i_1"), Trace("i_2", Role.SECOND)), limit="drive.i_max"),
        # The rig measures the filtered power; peaks of the raw power would hide it.
        Panel("power", (Trace("P_meas"), Trace("P_in", Role.SECOND))),
        Panel("force", (Trace("F_M"),)),
        _MODE,
        _WINDINGS,
        *_ADJUSTER,
    ),
)
"""moment, speed, current and power as in Figs. 7 to 9 of Roberts et al. (2003), and others"""

CORNER = Panels(
    "wedge-corner",
    ("wedge-corner",),
    (
        Panel("speed", (Trace("v_x"), Trace("v_tread", Role.SECOND)), height=1.8),
        Panel(
            "slip",
            (Trace("slip"), Trace("slip_hat", Role.SECOND)),
            saturation="abs",
            saturated="slip control",
        ),
        *BRAKING.panels[:2],
        Panel("normal force", (Trace("F_N"),)),
        Panel("heat", (Trace("T_disc"), Trace("T_pads", Role.SECOND))),
        _MODE,
        _WINDINGS,
        *_ADJUSTER,
    ),
)
"""vehicle at the top, brake below"""

ELECTRIC = Panels(
    "wedge-corner-electric",
    ("wedge-corner-electric",),
    (
        CORNER.panels[0],
        Panel(
            "braking torque",
            (Trace("T_m"), Trace("M_B", Role.SECOND), Trace("T_limit", Role.LIMIT)),
            height=1.8,
        ),
        CORNER.panels[1],
        Panel("charge", (Trace("soc"),)),
        replace(
            CORNER.panels[2],
            traces=tuple(each for each in CORNER.panels[2].traces if each.variable != "M_B"),
        ),
        *CORNER.panels[3:],
    ),
)
"""as the corner, with the torques of motor and brake"""

DRIVES = Panels(
    "wedge-drives",
    ("wedge-brake", "screw-rig", "shaft-rig"),
    (
        Panel(
            "angle",
            (
                Trace("theta_1"),
                Trace("theta_2", Role.SECOND),
                Trace("theta_1_ref", Role.SET_POINT),
            ),
            height=1.8,
        ),
        Panel("motor speed", (Trace("omega_1"), Trace("omega_2", Role.SECOND))),
        Panel(
            "current",
            (Trace("i_1"), Trace("i_2", Role.SECOND), Trace("i_1_ref", Role.SET_POINT)),
            limit="drive.i_max",
        ),
        Panel("force", (Trace("y_F"),)),
        Panel("force", (Trace("F_M"),)),
        Panel("power", (Trace("P_meas"), Trace("P_in", Role.SECOND))),
        Panel("power", (Trace("P_el"),)),
    ),
)
"""motors and screws alone, or the brake under position or current control"""

COMPARED: Mapping[str, str] = MappingProxyType(
    {"y_M": "moment", "theta": "angle", "F_M": "force", "i_2": "current 2", "P_meas": "power"}
)
"""signals that overlaid traces compare, with short names for low panels"""

SLIDERS = Sliders(
    "wedge",
    ("wedge-brake",),
    (
        "wedge.mu_B",
        "wedge.alpha",
        "caliper.K_cal",
        "caliper.clearance",
        "heart.K_W",
        "control.moment.f_c",
    ),
)
"""parameters with the most effect on braking, at the top of this brake's pages"""
