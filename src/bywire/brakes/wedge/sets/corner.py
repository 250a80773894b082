"""The wedge brake on the front corner of a mid-size car."""

from __future__ import annotations

from bywire.brakes.wedge.rigs.wedge_corner import WedgeCornerParameters
from bywire.brakes.wedge.sets import roberts2003
from bywire.core.catalog import CitedSet
from bywire.core.provenance import chosen, derived
from bywire.plant.road import SURFACES

_ADHESION = {
    name: derived(value, "dry asphalt for car tyres, as circulated")
    for name, value in SURFACES["dry-asphalt"]._asdict().items()
}

_HEAT_FROM = "as for the motorcycle: usual ranges"
_HEAT = {
    "law": chosen("off", "optional element, off"),
    "C_d": derived(8.0 * 480.0, "a vented disc of 8 kg"),
    "C_p": derived(2 * 0.35 * 1000.0, "two pads of 350 g"),
    "C_f": chosen(3500.0, "caliper with wedge, screws and motors' mounts, 5 kg"),
    "psi": chosen(0.93, _HEAT_FROM),
    "A": chosen(0.25, "both faces and the vents of a disc of 280 mm"),
    "h_0": chosen(8.0, _HEAT_FROM),
    "h_1": chosen(7.0, _HEAT_FROM),
    "v_ref": chosen(1.0, "h in W/(m^2 K) with v in m/s"),
    "epsilon": chosen(0.55, _HEAT_FROM),
    "sigma": derived(5.670374419e-8, "constant of Stefan and Boltzmann"),
    "G_dp": chosen(2.0, "two pads of 50 cm^2 pressed on"),
    "G_open": chosen(0.3, "a gap of air of some 0.1 mm"),
    "G_pf": chosen(1.5, "backing plates and rollers"),
    "G_f": chosen(2.0, "a caliper in the wind"),
    "T_a": chosen(293.15, "20 degC"),
    "T_1": chosen(623.15, _HEAT_FROM),
    "T_2": chosen(873.15, _HEAT_FROM),
    "f": chosen(0.6, _HEAT_FROM),
    "T_boil": chosen(2000.0, "no fluid to boil"),
    "T_wet": chosen(2000.0, "no fluid to boil"),
    "T_most": chosen(923.15, "650 degC, gray cast iron"),
}

_RULES_FROM = "as tuned for pressure loops of 10 Hz on a motorcycle, none for this brake"
_RULES = {
    "slip_keep": 0.345,
    "slip_dump": 0.51,
    "slip_back": 0.224,
    "t_lead": 0.133,
    "a_hold": 13.7,
    "t_hold": 0.0265,
    "t_most": 0.47,
    "dump": 100.0,
    "depth": 0.935,
    "back": 1.015,
    "t_step": 0.0183,
    "step": 0.0425,
    "growth": 1.12,
    "tau_a": 0.0055,
    "tau_p": 0.025,
    "v_off": 2.0,
    "v_fall": 4.85,
}

CORNER = CitedSet(
    name="roberts2003-corner",
    assembly="wedge-corner",
    source=roberts2003.SOURCE
    + "; adhesion: values that circulate under the name of M. Burckhardt, 1993; the corner is "
    "chosen",
    summary="the wedge brake on the front corner of a mid-size car",
    parameter_class=WedgeCornerParameters,
    values={
        **roberts2003.ENTRIES[0].values,
        "flywheel.J_F": chosen(1.2, "wheel, tyre and disc of a mid-size car"),
        "ecu.T_s": chosen(1e-3, "as the moment control's"),
        "ecu.abs": chosen("pi", "an experiment's choice"),
        "ecu.sees": chosen("estimated", "as on the road"),
        "ecu.M_rate": chosen(18e3, "what the software rate limit of 60 rad/s gives, 300 N m/rad"),
        "ecu.M_least": chosen(20.0, "above the threshold of contact: no gap to be crossed again"),
        "ecu.encoder.law": chosen("pulses", "as wheel sensors are"),
        "ecu.encoder.pulses": chosen(48.0, "usual; 100 on some"),
        "ecu.encoder.omega_min": chosen(0.1, "far below walking pace"),
        "ecu.tau_a": chosen(0.01, "short beside the moment loop"),
        "ecu.wheel_speed.law": chosen("period", "differences of 48 pulses are too coarse"),
        "ecu.wheel_speed.pulses": chosen(48.0, "as the sensor has"),
        "ecu.vehicle_speed.law": chosen("accelerometer", "there is one wheel, and it slips"),
        "ecu.vehicle_speed.a_max": chosen(12.26, "1.25 g"),
        "ecu.vehicle_speed.slip_small": chosen(0.005, "a rolling wheel's"),
        "ecu.vehicle_speed.tau": chosen(0.2, "long beside the first bite, which slips less"),
        "ecu.vehicle_speed.v_still": chosen(1.0, "an edge then comes every 40 ms"),
        "ecu.slip.schedule": chosen("speed", "gain and pole of a wheel fall with its speed"),
        "ecu.slip.slip_set": chosen(0.105, "0.8 of the peak's on wet asphalt"),
        "ecu.slip.omega_c": chosen(16.0, "a third of the moment loop's 8 Hz"),
        "ecu.slip.T_i": chosen(0.25, "four times the crossover's"),
        "ecu.slip.eager": chosen(10.0, "2 s on the stiff side of dry asphalt become 0.3 s"),
        "ecu.slip.T_t": chosen(0.0625, "the crossover's"),
        "ecu.slip.v_off": chosen(2.0, "48 pulses then come every 20 ms"),
        "ecu.slip.v_fall": chosen(6.0, "an edge of 48 pulses comes every 7 ms"),
        "ecu.slip.v_fixed": chosen(15.0, "the middle of a stop"),
        "ecu.slip.J_hat": chosen(1.2, "that of the wheel"),
        "ecu.slip.r_hat": chosen(0.30, "that of the wheel"),
        "ecu.slip.k_hat": chosen(1e-4, "1000 N m stand for 100 bar: no number depends on it"),
        **{f"ecu.rules.{name}": chosen(value, _RULES_FROM) for name, value in _RULES.items()},
        **{f"corner.heat.{name}": value for name, value in _HEAT.items()},
        "corner.body.m": chosen(450.0, "front corner of a mid-size car"),
        "corner.body.g": chosen(9.81, "gravity"),
        "corner.r": chosen(0.30, "rolling radius of a mid-size car's wheel"),
        "corner.tyre.curve": chosen("burckhardt", "its numbers circulate for seven surfaces"),
        "corner.tyre.sigma": chosen(0.20, "a car tyre's, of the order of its contact's length"),
        "corner.tyre.c_t": chosen(1.1, "a tenth of critical damping of a vehicle on stuck tyres"),
        "corner.tyre.v_low": chosen(2.0, "above, the relaxation length damps"),
        "corner.tyre.tau_slide": chosen(1e-4, "short beside all that a vehicle does"),
        "corner.road.grip": chosen(1.0, "as circulated"),
        **{f"corner.road.first.{name}": value for name, value in _ADHESION.items()},
        **{f"corner.road.further.{name}": value for name, value in _ADHESION.items()},
        "corner.road.x_change": chosen(1e4, "beyond any stop: one road, unless told"),
        "corner.road.x_back": chosen(2e4, "behind that"),
        "corner.road.ramp": chosen(0.01, "a jump, next to the length of a tyre's contact"),
        "corner.road.gradient": chosen(0.0, "an experiment's choice"),
        "corner.road.gradient_further": chosen(0.0, "an experiment's choice"),
    },
)
