"""A sport motorcycle of the 600 to 1000 cm^3 class with its rider."""

from __future__ import annotations

from typing import Any

from bywire.brakes.two_wheeler.parameters import TwoWheelerParameters
from bywire.core.catalog import CitedSet
from bywire.core.provenance import chosen, derived, paper
from bywire.plant.road import SURFACES

_LAP = "Table legacy/bike_params_r6.csv, a 600 cm^3 sport motorcycle with rider"
SOURCE = (
    "mass, drag and rolling resistance: R. Graham, motorcycle-lap-sim, open source; rear brake: "
    "A. Dardanelli, G. Alli, S. M. Savaresi, Modeling and control of an electro-mechanical "
    "brake-by-wire actuator for a sport motorbike, 2010; adhesion: values for car tyres that "
    "circulate under the name of M. Burckhardt, Fahrwerktechnik: Radschlupf-Regelsysteme, 1993; "
    "the rest is chosen for the class"
)
_CLASS = "class of 600 to 1000 cm^3 sport motorcycles with rider"
_TYRE = {
    "curve": chosen("burckhardt", "its numbers circulate for seven surfaces"),
    "sigma": chosen(0.10, "tyre transients of the order of 0.1 s at walking pace"),
    "c_t": chosen(1.1, "a tenth of critical damping of the vehicle on its stuck tyres"),
    "v_low": chosen(2.0, "above, the relaxation length damps"),
    "tau_slide": chosen(1e-4, "short beside all that a vehicle does"),
}
_SLIP = {
    "schedule": chosen("speed", "gain and pole of a wheel fall with its speed"),
    "slip_set": chosen(0.105, "0.8 of the peak's on wet asphalt; others are flat there"),
    "omega_c": chosen(20.0, "a third of a 10 Hz pressure loop"),
    "T_i": chosen(0.2, "four times the crossover's"),
    "eager": chosen(0.0, "a plain integral, as in the trial; 10 gains 2 % on dry asphalt"),
    "T_t": chosen(0.05, "the crossover's"),
    "v_off": chosen(2.0, "48 pulses then come every 20 ms"),
    "v_fall": chosen(6.0, "an edge of 48 pulses comes every 7 ms"),
    "v_fixed": chosen(15.0, "the middle of a stop"),
}
_AXLE = {  # of the heat of front and rear brake
    "law": chosen("off", "an experiment's choice"),
    "psi": chosen(0.93, "discs of steel take nearly all"),
    "h_0": chosen(8.0, "free convection, with the draft of a standing wheel"),
    "h_1": chosen(7.0, "a ventilated wheel: 100 W/(m^2 K) at 100 km/h, in all"),
    "v_ref": chosen(1.0, "the speed of 1 m/s"),
    "epsilon": chosen(0.55, "braked steel"),
    "sigma": derived(5.670374419e-8, "CODATA 2018"),
    "T_a": chosen(293.15, "20 degC"),
    "T_1": chosen(623.15, "350 degC: sintered pads of the road"),
    "T_2": chosen(873.15, "600 degC"),
    "f": chosen(0.6, "sintered pads of the road"),
    "T_boil": derived(503.15, "DOT 4, 230 degC: FMVSS 116"),
    "T_wet": derived(428.15, "DOT 4, 155 degC: FMVSS 116"),
    "T_most": chosen(923.15, "650 degC: discs of stainless steel begin to temper and warp"),
}
_SOUGHT = (
    "found by search for the shortest stops on five surfaces, the worst of 48 angles of the pulse "
    "wheels, rounded"
)
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
    "v_fall": 4.85,
}
_DRY = {
    name: derived(value, "dry asphalt for car tyres, as circulated")
    for name, value in SURFACES["dry-asphalt"]._asdict().items()
}


def _gain(disc: Any) -> float:
    """Return the torque over the pressure of a brake."""
    gain: float = disc.faces * disc.mu_pad * disc.A_cal * disc.r_eff
    return gain


def _lift(body: Any) -> float:
    """Return the deceleration at which lift control acts, just below that of lifting."""
    limit: float = 0.95 * body.g * body.l_f / body.h
    return limit


SPORT600 = CitedSet(
    name="sport600",
    assembly="two-wheeler-by-wire",
    source=SOURCE,
    summary="sport motorcycle with rider, pressure loops of 10 Hz",
    parameter_class=TwoWheelerParameters,
    values={
        "vehicle.body.m": paper(265.0, _LAP),
        "vehicle.body.L": chosen(1.40, _CLASS),
        "vehicle.body.l_f": chosen(0.69, "static load 51 % in front"),
        "vehicle.body.h": chosen(0.62, "lifts its rear wheel at 1.11 g"),
        "vehicle.body.h_a": chosen(0.62, "that of the center of gravity: drag does not pitch"),
        "vehicle.body.inertia": chosen(35.0, "radius of gyration 0.36 m"),
        "vehicle.body.CdA": paper(0.40, _LAP),
        "vehicle.body.rho": chosen(1.225, "standard atmosphere at sea level"),
        "vehicle.body.g": chosen(9.81, "gravity"),
        "vehicle.body.load": chosen("lagged", "suspensions carry load over in 0.1 s"),
        "vehicle.body.tau_N": chosen(0.080, "pitch mode of 2 Hz, well damped"),
        "vehicle.ground.k": chosen(1e6, "stiff: what lags is tau_N"),
        "vehicle.ground.tau": chosen(1e-2, "more than critical: a landing does not rebound"),
        "vehicle.front_wheel.J": chosen(0.50, "17 inch wheel with two discs"),
        "vehicle.front_wheel.r": chosen(0.30, "120/70 R17"),
        "vehicle.front_wheel.C_rr": paper(0.015, _LAP),
        "vehicle.rear_wheel.J": chosen(0.65, "17 inch wheel with disc and sprocket"),
        "vehicle.rear_wheel.r": paper(0.31, _LAP),
        "vehicle.rear_wheel.C_rr": paper(0.015, _LAP),
        **{f"vehicle.front_tyre.{name}": value for name, value in _TYRE.items()},
        **{f"vehicle.rear_tyre.{name}": value for name, value in _TYRE.items()},
        "vehicle.road.grip": chosen(1.0, "as circulated"),
        **{f"vehicle.road.first.{name}": value for name, value in _DRY.items()},
        **{f"vehicle.road.further.{name}": value for name, value in _DRY.items()},
        "vehicle.road.x_change": chosen(1e4, "beyond any stop: one road, unless told"),
        "vehicle.road.x_back": chosen(2e4, "behind that"),
        "vehicle.road.ramp": chosen(0.01, "a jump, next to the length of a tyre's contact"),
        "vehicle.road.gradient": chosen(0.0, "an experiment's choice"),
        "vehicle.road.gradient_further": chosen(0.0, "an experiment's choice"),
        "front.circuit.f_n": chosen(10.0, "the loop of the source of the rear brake"),
        "front.circuit.zeta": chosen(0.7, "no overshoot of note"),
        "front.disc.faces": chosen(4.0, "two discs"),
        "front.disc.mu_pad": chosen(0.45, "sintered pads"),
        "front.disc.A_cal": chosen(14.1e-4, "four pistons of 30 mm, two on each side"),
        "front.disc.r_eff": chosen(0.13, "disc of 310 mm"),
        "front.disc.T_drag": chosen(0.0, "a fault, off"),
        **{f"front.heat.{name}": value for name, value in _AXLE.items()},
        "front.heat.C_d": derived(2 * 1.3 * 480.0, "two discs of 1.3 kg, steel"),
        "front.heat.C_p": derived(4 * 0.090 * 1000.0, "four pads of 90 g"),
        "front.heat.C_f": chosen(930.0, "two calipers of aluminum with their fluid"),
        "front.heat.A": chosen(0.18, "two discs of 310 mm, both faces and the holes"),
        "front.heat.G_dp": chosen(1.5, "four pads pressed on"),
        "front.heat.G_open": chosen(0.2, "a gap of air of some 0.1 mm"),
        "front.heat.G_pf": chosen(2.0, "pistons and their fluid"),
        "front.heat.G_f": chosen(1.2, "calipers in the wind"),
        **{f"rear.heat.{name}": value for name, value in _AXLE.items()},
        "rear.heat.C_d": derived(1.0 * 480.0, "one disc of 1 kg, steel"),
        "rear.heat.C_p": derived(2 * 0.070 * 1000.0, "two pads of 70 g"),
        "rear.heat.C_f": chosen(400.0, "one caliper of aluminum with its fluid"),
        "rear.heat.A": chosen(0.06, "one disc of 220 mm, both faces and the holes"),
        "rear.heat.G_dp": chosen(0.5, "two pads pressed on, smaller than in front"),
        "rear.heat.G_open": chosen(0.07, "as in front, for its pads"),
        "rear.heat.G_pf": chosen(0.7, "as in front, for its pistons"),
        "rear.heat.G_f": chosen(0.5, "as in front, for its caliper"),
        "rear.circuit.f_n": paper(10.0, "section 2"),
        "rear.circuit.zeta": chosen(0.7, "no overshoot of note"),
        "rear.disc.faces": chosen(2.0, "one disc"),
        "rear.disc.mu_pad": chosen(0.40, "organic pads"),
        "rear.disc.A_cal": derived(3e-4, "A_pd of Table 1, rounded"),
        "rear.disc.r_eff": chosen(0.095, "disc of 220 mm"),
        "rear.disc.T_drag": chosen(0.0, "a fault, off"),
        "sensors.encoder.law": chosen("pulses", "as wheel sensors are"),
        "sensors.encoder.pulses": chosen(48.0, "usual; 100 on some"),
        "sensors.encoder.omega_min": chosen(0.1, "far below walking pace"),
        "sensors.a_offset": chosen(0.0, "an experiment's choice"),
        "sensors.tau_a": chosen(0.01, "short beside the pressure loop"),
        "ecu.T_s": paper(1e-3, "section 2"),
        "ecu.abs": chosen("pi", "an experiment's choice"),
        "ecu.lift": chosen("pi", "an experiment's choice"),
        "ecu.sees": chosen("estimated", "as on the road"),
        "ecu.p_rate": chosen(
            2e7, "200 bar/s: faster, and the front wheel locks before it is loaded"
        ),
        "ecu.wheel_speed.law": chosen("period", "differences of 48 pulses are too coarse"),
        "ecu.wheel_speed.pulses": chosen(48.0, "as the sensor has"),
        "ecu.vehicle_speed.law": chosen("accelerometer", "both wheels slip together"),
        "ecu.vehicle_speed.a_max": chosen(12.26, "1.25 g"),
        "ecu.vehicle_speed.slip_small": chosen(0.005, "a rolling wheel's"),
        "ecu.vehicle_speed.tau": chosen(
            0.2, "long beside the first bite, which slips less at first"
        ),
        "ecu.vehicle_speed.v_still": chosen(1.0, "an edge then comes every 40 ms"),
        "ecu.mix.alpha": chosen(1.0, "slip alone"),
        "ecu.mix.eta_set": chosen(0.8, "a full stop on wet asphalt"),
        "ecu.mix.tau": chosen(0.02, "the noise of edges, short beside the loop"),
        "ecu.mix.g": chosen(9.81, "gravity"),
        **{f"ecu.front_slip.{name}": value for name, value in _SLIP.items()},
        "ecu.front_slip.J_hat": chosen(0.50, "that of the wheel"),
        "ecu.front_slip.r_hat": chosen(0.30, "that of the wheel"),
        "ecu.front_slip.k_hat": derived(lambda par: _gain(par.front.disc), "that of the discs"),
        **{f"ecu.rear_slip.{name}": value for name, value in _SLIP.items()},
        "ecu.rear_slip.J_hat": chosen(0.65, "that of the wheel"),
        "ecu.rear_slip.r_hat": chosen(0.31, "that of the wheel"),
        "ecu.rear_slip.k_hat": derived(lambda par: _gain(par.rear.disc), "that of the disc"),
        **{f"ecu.rules.{name}": chosen(value, _SOUGHT) for name, value in _RULES.items()},
        "ecu.rules.v_off": chosen(2.0, "as that of slip control"),
        "ecu.front_lift.a_lim": derived(lambda par: _lift(par.vehicle.body), "0.95 of g l_f/h"),
        "ecu.front_lift.k_p": chosen(1e5, "1 bar for 1 m/s^2: an eighth of the static gain"),
        "ecu.front_lift.T_i": chosen(0.05, "crosses over at 1.3 Hz, below the load's transfer"),
        "ecu.front_lift.T_t": chosen(0.05, "as that of slip control"),
    },
)
