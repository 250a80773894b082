"""Which function over which argument is characteristic of each element."""

from __future__ import annotations

import importlib
import math
from pathlib import Path
from types import ModuleType
from typing import Any

from bywire import plant
from site_pages.curves import Course, Curve, Declared, caption, draw

PLACE = "figures"
"""folder of the figures, beside the pages of the elements"""

BAR, MM, UM, DEG = 1e5, 1e-3, 1e-6, math.pi / 180.0
SHAFT = 100.0 * math.pi  # speed of a pump [rad/s], 3000 rpm


def _strokes(t: float) -> float:
    """Speed [m/s] of a motion to 0.2 mm, back to zero, and then between 0.05 and 0.15 mm."""
    speeds = (0.2, 0.2, -0.2, -0.2, 0.3, -0.2, 0.2)  # mm/s, each for half a second
    return speeds[min(int(2.0 * t), len(speeds) - 1)] * MM


_DRY = {
    "c1": 1.2801,
    "c2": 23.99,
    "c3": 0.52,
    "B": 9.121,
    "C": 1.841,
    "D": 1.17,
    "E": 0.7324,
}
_GROUND = {f"ground.{name}": value for name, value in _DRY.items()}
_TYRE = {f"u.{name}": value for name, value in _DRY.items()}
_INTERIOR = {
    "par.p": 3.0,
    "par.R": 0.018,
    "par.L_d": 0.37e-3,
    "par.L_q": 1.2e-3,
    "par.psi": 0.066,
    "par.iron": "off",
}
_SEAT = {"seat.d": 0.6 * MM, "seat.C_d": 0.65, "seat.Re_cr": 100.0}
_FLUID = {f"fluid.{name}": value for name, value in {"nu": 12e-6, "rho": 1070.0}.items()}

FIGURES: dict[str, Declared] = {
    "abs_modulator": Course("x.hold", 0.1, {"u.close": lambda t: 1.0 if t < 0.05 else 0.0}),
    "accumulator": Curve("pressure", "x.V", (-20e-9, 3.502e-6)),
    "adc": Curve("rounded", "reading", (0.0, 0.01), {"par.law": "quantized"}),
    "adhesion": Curve(
        "adhesion",
        "slip",
        (0.0, 1.0),
        _GROUND,
        ("par.curve", ("burckhardt", "magic-formula")),
    ),
    "air": Curve("exergy", "p", (1.0 * BAR, 10.0 * BAR)),
    "air_orifice": Curve(
        "output.mdot",
        "u.p_b",
        (1.0 * BAR, 8.0 * BAR),
        {"u.p_a": 8.0 * BAR, "u.T_a": 293.15, "u.T_b": 293.15, "u.opening": 1.0},
        ("par.b", (0.2, 0.3, 0.5)),
    ),
    "air_volume": Curve(
        "pressure",
        "u.V",
        (0.5e-3, 2e-3),
        {"x.m": 5e-3, "x.T": 293.15},
        ("x.m", (3e-3, 5e-3, 8e-3)),
    ),
    "angle_sensor": Curve(
        "reading",
        "theta",
        (0.0, 2.0 * math.pi),
        {"par.law": "real", "par.counts": 64.0, "par.eps_2": 0.1},
    ),
    "anti_alias_filter": Course("x.y", 0.005, {"u.raw": 1.0}),
    "axial_bearing": Curve("friction", "u.omega", (-20.0, 20.0), {"u.force": 1e4}),
    "backlash": Curve(
        "forces.front", "u.theta_1", (-0.05, 0.05), {}, ("par.b", (5e-3, 10e-3, 20e-3))
    ),
    "ball_ramp": Curve(
        "load_torque", "u.force", (0.0, 3e4), {}, ("par.alpha", (2 * DEG, 3 * DEG, 5 * DEG))
    ),
    "ball_screw_gear": Curve("output.x", "x.theta", (0.0, 60.0)),
    "battery_supply": Curve("output.v_bus", "u.i_dc", (0.0, 60.0)),
    "brake_chamber": Curve(
        "output.F", "u.x", (0.0, 0.06), {}, ("u.p", (2 * BAR, 4 * BAR, 6 * BAR))
    ),
    "brake_disc": Curve(
        "output.torque", "u.p", (0.0, 60 * BAR), {}, ("par.mu_pad", (0.35, 0.45, 0.55))
    ),
    "brake_fluid": Curve(
        "gas_volume", "p", (0.0, 20 * BAR), {"par.air": "entrained", "par.V_air": 1e-7}
    ),
    "caliper": Course("x.p", 0.05, {"u.q": 3e-6}),
    "caliper_piston": Course("x.v", 0.002, {"u.q": 1e-5}, lines=("par.d", (1e3, 2e3, 4e3))),
    "check_valve": Curve("flow", "u.p_a", (-5 * BAR, 10 * BAR), _FLUID),
    "clearance_adjuster": Course("x.taken", 0.2, {"u.turning": 1.0, "par.law": "screw"}),
    "compressor": Curve("output.mdot", "u.p", (1.0 * BAR, 12 * BAR), {"u.on": 1.0}),
    "corner_body": Course("x.v", 3.0, {"u.F": 3000.0, "x.v": 20.0}),
    "cup_seal": Curve("output.F_p", "u.v", (0.0, 0.1), {}, ("u.p", (0.0, 20 * BAR, 40 * BAR))),
    "current_drive": Course("x.demand", 0.01, {"u.i_ref": 10.0, "u.on": 1.0}),
    "current_sensor": Curve("reading", "i", (-60.0, 60.0)),
    "dc_link": Course(
        "x.v",
        0.02,
        {"u.i_dc": lambda t: 40.0 if t < 0.005 else -40.0, "x.v": 24.0},
        lines=("par.chopper", ("off", "resistor")),
    ),
    "dc_motor": Course("x.i", 0.01, {"u.v": 12.0}, lines=("u.omega", (0.0, 100.0, 200.0))),
    "disc_heat": Curve("friction", "T_disc", (293.0, 1000.0), {"par.law": "lumped"}),
    "drive_supply": Course("x.P", 0.5, {"u.motors": 200.0}),
    "driven_rotor": Course("x.omega", 0.1, {"u.i": 2.0, "u.load": 0.2}),
    "drum": Curve(
        "output.T_p",
        "par.mu",
        (0.1, 0.5),
        {"u.force": 2000.0},
        ("par.law", ("simplex", "duplex", "servo")),
    ),
    "end_stop": Curve(
        "forces.far", "u.x", (0.0, 12 * MM), {"u.x_end": 10 * MM, "u.x_rest": -10 * MM}
    ),
    "floating_caliper": Curve(
        "forces.F_cl", "u.x", (0.0, 1.5 * MM), {}, ("par.clearance", (0.2 * MM, 0.4 * MM, 0.6 * MM))
    ),
    "fluid_vapor": Curve("volume", "T", (400.0, 480.0), {}, ("par.water", (0.0, 0.02, 0.037))),
    "flux_map": Curve("flux.psi_q", "i.i_q", (-20.0, 20.0), {}, ("i.i_d", (-15.0, 0.0, 15.0))),
    "flywheel": Course(
        "x.Omega", 0.3, {"u.friction": -200.0, "x.Omega": 60.0, "par.law": "coasting"}
    ),
    "force_sensor": Curve("force", "u.X_1", (0.0, 50 * UM)),
    "governor": Curve(
        "output.on", "u.p", (6.0 * BAR, 10.0 * BAR), {"x.on": 1.0}, ("x.on", (0.0, 1.0))
    ),
    "ground_support": Curve("forces.support", "u.z", (-0.01, 0.01)),
    "h_bridge": Curve("output.v", "u.duty", (-1.0, 1.0), {"u.v_bus": 12.0}),
    "inverter": Curve(
        "output.v_d",
        "u.i_d",
        (-2.0, 2.0),
        {"u.V_dc": 24.0, "par.law": "dead time"},
        ("par.t_d", (0.0, 1e-6, 2e-6)),
    ),
    "lead_screw": Curve(
        "efficiencies.eta_b", "par.mu", (0.02, 0.3), {}, ("par.lead", (2 * MM, 4 * MM, 6 * MM))
    ),
    "lever": Curve(
        "slope", "x", (0.0, 40 * MM), {"par.law": "turning"}, ("par.phi_0", (0.0, 0.25, 0.5))
    ),
    "master_cylinder": Course("x.p", 0.02, {"u.v": 0.01}),
    "moment_sensor": Course("x.M", 0.05, {"u.M": 300.0}),
    "motor_heat": Course(
        "x.T_winding",
        3600.0,
        {"x.T_winding": 293.15, "x.T_housing": 293.15, "par.law": "lumped"},
        lines=("u.P", (5.0, 10.0, 20.0)),
    ),
    "orifice": Curve(
        "flow",
        "u.p_a",
        (-20 * BAR, 20 * BAR),
        {"u.opening": 1.0, **_FLUID},
        ("par.d", (0.4 * MM, 0.5 * MM, 0.6 * MM)),
    ),
    "pad_hysteresis": Course("output.F_hysteresis", 3.5, {"u.v": _strokes}, "u.v"),
    "pad_wear": Curve("wear_per_work", "T", (300.0, 900.0)),
    "parking_cable": Curve(
        "output.F_p", "u.tension", (0.0, 1000.0), {}, ("par.phi", (1.0, 3.0, 6.0))
    ),
    "pawl_lock": Curve("release_force", "torque", (0.0, 0.4), {}, ("par.mu", (0.1, 0.15, 0.2))),
    "pedal": Curve("output.x", "u.force", (0.0, 100.0)),
    "pedal_simulator": Curve("spring_force", "u.x", (-2 * MM, 20 * MM)),
    "pipeline": Curve("output.q", "u.p_a", (-10 * BAR, 10 * BAR)),
    "piston_friction": Curve(
        "thresholds.inward", "par.F_fr", (0.0, 200.0), {"par.law": "sticking"}
    ),
    "planetary_gear": Curve(
        "output.load", "u.load", (-10.0, 10.0), {}, ("par.z_ring", (60.0, 72.0, 90.0))
    ),
    "pmsm": Curve(
        "airgap_torque", "x.i_q", (-240.0, 240.0), _INTERIOR, ("x.i_d", (0.0, -100.0, -200.0))
    ),
    "pressure_loop": Course(
        "x.p", 0.3, {"u.p_ref": 40 * BAR}, lines=("par.f_n", (5.0, 10.0, 20.0))
    ),
    "pressure_sensor": Curve("reading", "p", (-10 * BAR, 100 * BAR)),
    "proportional_valve": Curve(
        "held_pressure", "i", (1.0, 2.5), {}, ("par.seat.d", (0.5 * MM, 0.6 * MM, 0.8 * MM))
    ),
    "rack": Curve("output.load", "u.force", (-1000.0, 1000.0)),
    "relay_valve": Curve("output.feed", "x.s", (-1.0, 1.0)),
    "reservoir_port": Curve("output.G", "u.x", (0.0, 2 * MM), {"par.law": "dead-stroke"}),
    "return_pump": Course(
        "output.q_d",
        0.03,
        {
            "u.theta": lambda t: SHAFT * t,
            "u.omega": SHAFT,
            "u.p_d": 100 * BAR,
            "u.p_s": 2 * BAR,
            "x.V": 33e-9,
        },
        lines=("par.suction.seat.d", (2.5 * MM, 1.0 * MM, 0.6 * MM)),
    ),
    "road": Curve(
        "share", "x", (0.0, 60.0), {"par.x_change": 20.0, "par.x_back": 45.0, "par.ramp": 2.0}
    ),
    "road_wheel": Curve("rolling_resistance", "N", (0.0, 4000.0)),
    "roller_screw": Curve("load_torque", "u.force", (0.0, 3e4)),
    "seal_friction": Curve(
        "output.T_p", "u.omega", (0.0, 20.0), {}, ("u.p", (0.0, 20 * BAR, 40 * BAR))
    ),
    "seal_rollback": Course("output.F_seal", 3.5, {"u.v": _strokes}, "u.v"),
    "servo_motor": Course("x.omega", 0.1, {"u.v": 10.0}),
    "shaft": Course("x.omega", 5.0, {"u.torque": 1e-3}),
    "shaft_encoder": Curve(
        "reading", "theta", (0.0, 0.05), {"par.law": "quantized", "par.counts": 800.0}
    ),
    "solenoid_armature": Curve(
        "magnetic_force", "x.x", (0.0, 0.25 * MM), {}, ("i", (1.0, 2.0, 3.0))
    ),
    "solenoid_valve": Course(
        "flow",
        0.03,
        {"u.on": lambda t: 1.0 if 0.005 < t < 0.015 else 0.0, "x.x": 0.18 * MM, **_FLUID},
        lines=("u.p_a", (50 * BAR, 100 * BAR, 150 * BAR)),
    ),
    "spring_brake": Curve("spring_force", "x.x", (0.0, 0.06)),
    "stiffening_caliper": Curve("volume", "x.p", (0.0, 100 * BAR)),
    "tandem_master_cylinder": Curve(
        "output.F_spring_1", "x.x_1", (10 * MM, 28 * MM), {}, ("x.x_2", (0.0, 5 * MM, 10 * MM))
    ),
    "thermal_growth": Course(
        "output.growth", 1800.0, {"x.T": 573.15}, lines=("par.tau", (300.0, 600.0, 1200.0))
    ),
    "traction_battery": Curve(
        "charging_limit", "x.soc", (0.0, 1.0), {}, ("par.T", (263.15, 273.15, 298.15))
    ),
    "two_wheeler_body": Curve(
        "rear_load", "F", (0.0, 3000.0), {"cosine": 1.0, "F_d": 0.0}, ("par.h", (0.5, 0.6, 0.7))
    ),
    "tyre": Course(
        "output.F",
        0.1,
        {"u.v": 20.0, "u.N": 3000.0, "u.mu_max": 1.17, "u.u_max": 0.034, **_TYRE},
        lines=("u.v_wheel", (19.8, 19.6, 19.0)),
    ),
    "wheel_encoder": Curve(
        "reading.angle", "x.theta", (0.0, 1.0), {"par.law": "pulses", "u.omega": 10.0}
    ),
    "wheel_motor": Curve("limit", "omega", (0.0, 100.0), {"v": 30.0}, ("P_bat", (5e3, 15e3, 25e3))),
}


def _saturated_map() -> dict[str, Any]:
    """Return the flux map of a motor that saturates in both axes, from one potential."""
    L, nodes = 0.2e-3, [20.0 * (k / 4 - 1) for k in range(9)]
    pairs = [(d / 20.0, q / 20.0) for d in nodes for q in nodes]
    return {
        "i_d": tuple(nodes),
        "i_q": tuple(nodes),
        "psi_d": tuple(20.0 * L * (d - 0.1 * d**3 - 0.1 * q * q) for d, q in pairs),
        "psi_q": tuple(20.0 * L * (1.5 * q - 0.2 * q * d - 0.25 * q**3) for d, q in pairs),
    }


VALUES: dict[str, dict[str, Any]] = {  # of elements that no parameter set contains or uses
    "adhesion": {"curve": "burckhardt"},
    "backlash": {"i": 1.0, "b": 10e-3, "k": 300.0, "tau": 1e-4},
    "ball_ramp": {"r": 20 * MM, "alpha": 3 * DEG, "mu": 0.0},
    "caliper_piston": {"A_pd": 1.96e-3, "V_0": 1e-5, "m": 0.3, "d": 1e3, "G_leak": 0.0},
    "cup_seal": {
        "F_pr": 10.0,
        "f_p": 1e-5,
        "f_n": 8e-6,
        "k_brk": 1.5,
        "v_S": 5e-3,
        "mu": 50.0,
    },
    "dc_link": {
        "law": "diode",
        "V_s": 24.0,
        "R_s": 0.02,
        "C": 5e-3,
        "chopper": "off",
        "V_on": 30.0,
        "R_on": 0.05,
        "V_most": 60.0,
    },
    "drum": {
        "law": "simplex",
        "r": 0.1015,
        "b": 0.036,
        "a": 0.083,
        "c": 0.165,
        "theta_1": 0.3,
        "theta_2": 2.3,
        "mu": 0.35,
    },
    "flux_map": _saturated_map(),
    "pad_hysteresis": {
        "law": "constant",
        "k_1": 1e7,
        "k_2": 5e6,
        "k_3": 2e6,
        "k_4": 1e6,
        "W_1": 100.0,
        "W_2": 150.0,
        "W_3": 150.0,
        "W_4": 100.0,
        "F_ref": 2e4,
    },
    "parking_cable": {"mu": 0.1, "phi": 3.0, "i": 5.0},
    "pad_wear": {
        "kappa_0": 3.6e-14,
        "T_hot": 503.0,
        "T_act": 2760.0,
        "n_pads": 2.0,
        "A_pad": 50e-4,
        "E_pad": 5e8,
    },
    "planetary_gear": {"z_sun": 18.0, "z_ring": 72.0, "eta": 0.95},
    "proportional_valve": {
        **_SEAT,
        "alpha": 0.8,
        "lift": 0.2 * MM,
        "m": 5e-3,
        "k_s": 2e3,
        "F_s0": 1.0,
        "d": 2.0,
        "F_h": 0.02,
        "G": 60 * BAR,
    },
    "rack": {"r_p": 15 * MM, "eta": 0.9},
    "seal_rollback": {"k": 6e5, "z_max": 0.06 * MM},
    "solenoid_armature": {
        **_SEAT,
        "unpowered": "closed",
        "alpha": 0.8,
        "travel": 0.25 * MM,
        "g_0": 0.4 * MM,
        "k_m": 1.2e-7,
        "L_0": 1e-3,
        "R": 4.5,
        "m": 3e-3,
        "d": 1.0,
        "k": 2e3,
        "F_s0": 4.0,
        "F_h": 0.2,
        "dirt": 0.0,
    },
    "tandem_master_cylinder": {
        "m_1": 0.2,
        "m_2": 0.1,
        "F_s1": 80.0,
        "k_s1": 4e3,
        "F_s2": 60.0,
        "k_s2": 4e3,
    },
}


def write(folder: Path) -> None:
    """Draw the figures of all elements into a folder."""
    for name, declared in FIGURES.items():
        element = importlib.import_module(f"{plant.__name__}.{name}")
        draw(element, declared, VALUES.get(name, {}), folder / f"{name}.svg")


def lines(element: ModuleType) -> list[str]:
    """Return the figure of an element's page, as reStructuredText; empty without a figure."""
    home, _, name = element.__name__.rpartition(".")
    if home != plant.__name__ or name not in FIGURES:
        return []
    declared, values = FIGURES[name], VALUES.get(name, {})
    text = caption(element, declared, values)
    return [f".. figure:: {PLACE}/{name}.svg", f"   :alt: {name}", "", f"   {text}", ""]
