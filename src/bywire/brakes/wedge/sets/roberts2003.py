"""Parameters of the wedge brake of Roberts et al. (2003).

The paper prints an efficiency, a carrier frequency and the moments of its tests; all other numbers
are ours, each with its reason. Where a value was tuned until a statement of the paper came out,
that statement is no evidence any more, and the value says so.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.brakes.wedge.sets import adjuster
from bywire.core.catalog import CitedSet
from bywire.core.provenance import Cited, calibrated, chosen, derived, paper

SOURCE = (
    "R. Roberts, M. Schautt, H. Hartmann, B. Gombert, Modelling and Validation of the Mechatronic "
    "Wedge Brake, SAE International, 2003"
)

_CLASS = "a servo motor of this size, two ILM-50 stators in parallel"
_LITERATURE = "within the range of wedge brakes in the literature"
_LOOP = "current loop of 1.2 kHz by pole cancellation"
_DEGREE, _MICRO = math.pi / 180.0, 1e-6
_ALPHA, _MU_B, _K_CAL, _R_B, _LEAD = 20.0 * _DEGREE, 0.35, 30e6, 0.125, 2e-3
_R, _L, _V, _LOOP_RATE = 0.45, 0.2e-3, 48.0, 2.0 * math.pi * 1200.0
_MU_B_HIGH, _ALPHA_STEEP = 0.45, 24.5 * _DEGREE


def _moment_slope(par: Any) -> float:
    """Return moment per angle in contact, which the moment controller knows."""
    wedge, caliper = par.wedge, par.caliper
    force = caliper.K_cal * math.tan(wedge.alpha) * _travel(par)
    slope: float = 2.0 * wedge.mu_B * caliper.r_B * force
    return slope


def _travel(par: Any) -> float:
    """Return travel per angle of a screw."""
    travel: float = par.screw.lead / (2.0 * math.pi)
    return travel


def _grease(bearing: Any) -> float:
    """Return the viscous friction of a bearing at the speed and the viscosity it is stated at."""
    torque: float = 1.2e-4 * (bearing.omega_ref * (bearing.nu_ref / _MICRO)) ** bearing.k_nu
    return torque


_MOTOR = {
    "R_ref": chosen(_R, _CLASS),
    "L_M": chosen(_L, "low, as the paper says of the motor"),
    "K_ref": chosen(0.10, _CLASS),
    "J_M": chosen(1.2e-4, "two rotors of this class, encoder, screw and bearings"),
    "D_M": chosen(1e-4, "small beside the bearings"),
    "T_cog": chosen(10e-3, "some 0.5 % of the peak torque"),
    "N_cog": chosen(180.0, "slots and poles of a segment motor"),
    "dT": chosen(0.0, "at the reference temperature"),
    "a_R": chosen(3.93e-3, "copper"),
    "a_K": chosen(1.1e-3, "neodymium magnets"),
}

_SIZE = "the size: 0.25 kg of copper, 0.9 kg of iron and aluminum, on the caliper"
_HAT = "the controller knows the motor"
_THERMAL = {
    "motor_heat.law": chosen("off", "optional element, off"),
    "motor_heat.C_w": chosen(95.0, _SIZE),
    "motor_heat.C_h": chosen(500.0, _SIZE),
    "motor_heat.G_wh": chosen(1.5, _SIZE),
    "motor_heat.G_ha": chosen(1.0, _SIZE),
    "motor_heat.a_R": chosen(3.93e-3, "copper"),
    "motor_heat.a_K": chosen(1.1e-3, "neodymium magnets"),
    "motor_heat.T_ref": chosen(293.15, "20 degC"),
    "motor_heat.T_a": chosen(293.15, "20 degC"),
    "motor_heat.T_most": chosen(428.15, "155 degC, insulation of class F"),
    "control.derating.law": chosen("off", "optional law, off"),
    "control.derating.R_hat": chosen(_R, _HAT),
    "control.derating.a_R_hat": chosen(3.93e-3, _HAT),
    "control.derating.C_w_hat": chosen(95.0, _HAT),
    "control.derating.C_h_hat": chosen(500.0, _HAT),
    "control.derating.G_wh_hat": chosen(1.5, _HAT),
    "control.derating.G_ha_hat": chosen(1.0, _HAT),
    "control.derating.T_ref_hat": chosen(293.15, _HAT),
    "control.derating.T_a_hat": chosen(293.15, "20 degC; a thermometer's reading on a vehicle"),
    "control.derating.T_derate": chosen(393.15, "120 degC, 35 K below the insulation's limit"),
    "control.derating.T_limit": chosen(418.15, "145 degC, 10 K below it"),
    "control.derating.i_least": chosen(5.0, "more than holds 600 N m at mu_B 0.35"),
}

_ELECTRICAL = {
    "supply.P_standby": calibrated(20.0, "tuned so that Fig. 9 needs about 60 W at the input"),
    "supply.tau_P": calibrated(0.03, "tuned so that Fig. 9 needs about 60 W at the input"),
    "drive.f_demand": chosen(1.5e3, "the filter that the paper had to add, small against the loop"),
    "drive.f_sense": chosen(8e3, "fast against the loop"),
    "drive.G_sense": chosen(1.0, "calibrated measurement"),
    "drive.i_max": chosen(20.0, "peak current of drives of this class"),
    "drive.k_p": derived(lambda par: par.motor_1.L_M * _LOOP_RATE / par.drive.V_dc, _LOOP),
    "drive.k_i": derived(lambda par: par.motor_1.R_ref * _LOOP_RATE / par.drive.V_dc, _LOOP),
    "drive.T_t": chosen(_L / _R, "the winding's time constant"),
    "drive.V_dc": chosen(_V, "supply of drives of this class"),
    "drive.R_off": chosen(_R, "empties the winding twice as fast as its own resistance"),
}

_MECHANICAL = {
    "screw.lead": chosen(_LEAD, "roller screws of this size; gives 4.85 rad at 950 N m"),
    "screw.eta_f": paper(0.65, "section 'Roller-screw efficiency': of the order of 65 %"),
    "screw.eta_b": derived(
        lambda par: 2.0 - 1.0 / par.screw.eta_f, "a friction that does not depend on the direction"
    ),
    "screw.law": chosen("load", "reading A: friction by the axial force"),
    "bearing.C_0": calibrated(0.08, "tuned so that the friction of Figs. 5 and 6 at 1 Hz shows"),
    "bearing.C_1": chosen(0.0, "the square alone, as in bearing catalogs"),
    "bearing.C_2": chosen(2.5e-9, "angular ball bearings of this size"),
    "bearing.T_nu": derived(lambda par: _grease(par.bearing), "G_nu 1.2e-4, nu in mm^2/s"),
    "bearing.omega_ref": chosen(100.0, "working speed"),
    "bearing.nu": chosen(100 * _MICRO, "grease at 40 degC"),
    "bearing.nu_ref": chosen(100 * _MICRO, "grease at 40 degC"),
    "bearing.k_nu": chosen(2.0 / 3.0, "bearing catalogs"),
    "bearing.G_S": chosen(0.3, "usual height of the Stribeck peak"),
    "bearing.k_S": chosen(1.0, "plain exponential"),
    "bearing.omega_S": chosen(2.0, "slow against the working speed"),
    "heart.K_S": chosen(60e6, "screw, nut and bearings in series"),
    "heart.K_W": chosen(40e6, "interfaces softer than the screws, as the tension test shows"),
    "heart.K_C": chosen(2e9, "hardened tips"),
    "heart.g_1": chosen(20 * _MICRO, "construction tolerance"),
    "heart.g_2": chosen(20 * _MICRO, "construction tolerance"),
    "heart.g_12": chosen(30 * _MICRO, "construction tolerance"),
    "heart.tau_heart": chosen(15 * _MICRO, "light damping"),
    "wedge.alpha": chosen(_ALPHA, _LITERATURE + ", 12 to 24.5 degrees"),
    "wedge.M_W": chosen(0.6, "steel wedge with pad; the literature has 0.3 kg"),
    "wedge.mu_B": chosen(_MU_B, "near tan(alpha), where the prototype works"),
    "wedge.k_return": chosen(0.0, "preloaded spring of the paper not printed; optional, off"),
    "wedge.x_stop": chosen(2.5e-3, "half as much again as the travel of 1.54 mm at 950 N m"),
    "wedge_friction.mu_int": chosen(0.10, "lubricated steel"),
    "wedge_friction.mu_R": chosen(0.005, "cylindrical rollers, with guidance"),
    "wedge_friction.stopped_disc": paper("drop", "section 'Wedge and calliper': pad term dropped"),
    "stop.k_stop": chosen(2e7, "stiff against the caliper's share, slow against the step"),
    "stop.tau_stop": chosen(1e-4, "a stop without rebound of note"),
    "caliper.law": chosen("linear", "the paper prints no curve"),
    "caliper.n_table": chosen((), "no measured curve"),
    "caliper.F_table": chosen((), "no measured curve"),
    "caliper.K_cal": chosen(_K_CAL, _LITERATURE + ", 6.8 to 44.8 N/um"),
    "caliper.tau_cal": chosen(20 * _MICRO, "light damping"),
    "caliper.clearance": chosen(0.2e-3, "usual running clearance"),
    "caliper.r_B": chosen(_R_B, "a passenger car's front disc"),
}

_STAND = {
    "flywheel.law": chosen("coasting", "AC motor off while braking; the paper is silent"),
    "flywheel.J_F": chosen(36.0, "a quarter of a passenger car at this radius"),
    "flywheel.Omega_0": chosen(60.0, "some 65 km/h"),
    "flywheel.K_drive": chosen(1e4, "keeps the speed within 0.2 % (law 'driven')"),
    "flywheel.Omega_still": chosen(1e-7, "none: a substep ends where the disc stops"),
    "flywheel.runout": chosen(4 * _MICRO, "what the floating caliper does not follow"),
    "moment_sensor.f_M": chosen(150.0, "stiff sensor with the caliper on it"),
    "encoder.law": chosen("quantized", "an incremental encoder counts"),
    "encoder.counts": chosen(16384.0, "4096 lines, four edges"),
}

_CONTROL = {
    "control.T_fast": chosen(2e-4, "5 kHz"),
    "control.T_slow": chosen(1e-3, "1 kHz"),
    "control.position.f_n": chosen(60.0, "the high bandwidth; the low one is 12 Hz"),
    "control.position.zeta": chosen(0.8, "well damped"),
    "control.position.c": chosen(0.0, "damping on the whole speed"),
    "control.position.f_speed": chosen(300.0, "smooths the encoder's differences"),
    "control.position.i_max": chosen(20.0, "limit of the drives"),
    "control.position.J_hat": chosen(1.2e-4, "the controller knows the motor"),
    "control.position.K_hat": chosen(0.10, "the controller knows the motor"),
    "control.offset.law": chosen("preload", "mu_B is near tan(alpha)"),
    "control.offset.delta_preload": chosen(42 * _MICRO, "preload of about 400 N"),
    "control.offset.delta_together": chosen(-16 * _MICRO, "half the tips' free-play, and a little"),
    "control.offset.T_change": chosen(0.05, "slow against the position loop"),
    "control.offset.F_low": chosen(500.0, "about the preload"),
    "control.offset.F_high": chosen(1000.0, "twice F_low"),
    "control.offset.k_hat": derived(_travel, "lead over 2 pi"),
    "control.moment.f_c": chosen(8.0, "slow against the position loop"),
    "control.moment.slope_hat": derived(_moment_slope, "2 mu_B r_B K_CAL tan(alpha) L/2pi"),
    "control.moment.rate_max": calibrated(60.0, "tuned so that Fig. 9 needs about 60 W"),
    "control.moment.omega_gap": chosen(120.0, "the gap in some 35 ms"),
    "control.moment.a_gap": chosen(6e3, "a third of the peak torque"),
    "control.moment.omega_creep": chosen(10.0, "gentle contact"),
    "control.moment.M_on": chosen(5.0, "below the contact threshold"),
    "control.moment.M_contact": chosen(12.0, "above the sensor's offset"),
    "control.moment.Omega_still": chosen(0.5, "a twelfth of a revolution per second"),
    "control.adjuster.gap_slope_hat": derived(
        lambda par: _travel(par) * math.tan(par.wedge.alpha), "L/2pi tan(alpha)"
    ),
    "command.mode": chosen("moment", "the experiment decides"),
}

_RIG = {
    "rig.mode_1": chosen("position", "the experiment decides"),
    "rig.mode_2": chosen("position", "the experiment decides"),
    "rig.load": chosen("screw", "the experiment decides"),
    "rig.clamp": chosen("open", "the experiment decides"),
    "rig.J_dummy": chosen(2e-5, "a steel shaft of 20 mm, 160 mm long"),
    "rig.F_0": chosen(200.0, "a tenth of the screw's force at half the peak current"),
    "rig.T_clamp": chosen(20.0, "ten times the motor's peak torque"),
    "rig.sensor.K_F": chosen(100e6, "strain-gauge sensors of some 5 kN with their adapters"),
    "rig.sensor.tau_F": chosen(15 * _MICRO, "light damping, as in the brake heart"),
    "rig.sensor.f_F": chosen(1e3, "usual carrier-frequency amplifiers"),
}

_VALUES = {
    **{f"motor_{k}.{name}": value for k in (1, 2) for name, value in _MOTOR.items()},
    **_ELECTRICAL,
    **_THERMAL,
    **_MECHANICAL,
    **_STAND,
    **_CONTROL,
    **adjuster.IN_ECU,
    **_RIG,
}

# Both keep what was calibrated with the first set: it belongs to motors and electronics.
_UNSTABLE = {
    "wedge.mu_B": chosen(_MU_B_HIGH, "above tan(alpha) = 0.364; friction holds it without power"),
}
_STEEP = {
    "wedge.alpha": chosen(_ALPHA_STEEP, _LITERATURE + ", the steep end: stable up to mu_B = 0.456"),
    "wedge.x_stop": chosen(2.5e-3, "twice the travel of 1.23 mm at 950 N m"),
    "control.offset.law": chosen("scheduled", "far from the neutral point both motors push"),
}


def _entry(
    name: str, summary: str, changes: Mapping[str, Cited] = MappingProxyType({})
) -> CitedSet:
    """Return an entry with some values of the first set changed."""
    return CitedSet(
        name=name,
        assembly="wedge-brake",
        source=SOURCE,
        summary=summary,
        parameter_class=WedgeParameters,
        values={**_VALUES, **changes},
    )


ENTRIES = (
    _entry("roberts2003", "self-reinforcing wedge brake with two motors, near its neutral point"),
    _entry(
        "roberts2003-unstable",
        "the same with pad friction 0.45 above tan(alpha): unstable without control",
        _UNSTABLE,
    ),
    _entry(
        "roberts2003-steep",
        "the same with a wedge of 24.5 degrees: always pushed, the motors share the load",
        _STEEP,
    ),
)
