"""The front wheel of a mid-size car. No public source gives a complete measured set."""

from __future__ import annotations

import math

from bywire.authoring import CitedSet, chosen, derived
from bywire.plant import brake_disc, orifice
from one_box.parameters import OneBoxParameters
from one_box.rigs.corner import OneBoxCornerParameters

BAR, CM3, MM = 1e5, 1e-6, 1e-3
_CAR = "front corner of a mid-size car"
_CLASS = "typical of this class"
_NONE = "no public source"
_ASSUMED = "same as the brake"
_ROAD = "dry asphalt, Burckhardt's values for a car tire"
_STRETCH = {"c1": 1.2801, "c2": 23.99, "c3": 0.52, "B": 9.121, "C": 1.841, "D": 1.17, "E": 0.7324}


def _valve(name: str, d: float, unpowered: str) -> dict[str, object]:
    return {
        f"{name}.seat.d": chosen(d, "gradients of 1000 to 2500 bar/s"),
        f"{name}.seat.C_d": chosen(0.65, "sharp edge"),
        f"{name}.seat.Re_cr": chosen(100.0, _NONE),
        f"{name}.lift": chosen(0.25 * MM, "opens the whole orifice"),
        f"{name}.alpha": chosen(math.radians(45.0), _NONE),
        f"{name}.t_delay": chosen(1e-3, _NONE),
        f"{name}.tau": chosen(1e-3, _NONE),
        f"{name}.unpowered": chosen(unpowered, "a dead unit leaves the driver's pressure"),
        f"{name}.low": chosen(0.0, "tight"),
        f"{name}.high": chosen(1.0, "opens fully"),
    }


NUMBERS = {
    "drive": chosen("pressure", "the experiment decides"),
    "fluid.beta": chosen(1.8e9, "brake fluid"),
    "fluid.nu": chosen(12e-6, "brake fluid at room temperature"),
    "fluid.rho": chosen(1070.0, "brake fluid"),
    "fluid.air": chosen("none", "bled"),
    "fluid.V_air": chosen(0.0, "bled"),
    "fluid.n_air": chosen(1.2, "without effect, no air"),
    "fluid.p_atm": chosen(101_325.0, "standard atmosphere"),
    "rod.m": chosen(1.0, _NONE),
    "rod.i": chosen(4.0, _CLASS),
    "rod.F_0": chosen(60.0, _NONE),
    "simulator.k_1": chosen(12e3, _NONE),
    "simulator.k_2": chosen(40e3, _NONE),
    "simulator.x_1": chosen(8 * MM, _NONE),
    "simulator.d_in": chosen(300.0, _NONE),
    "simulator.d_out": chosen(300.0, "equal, so linear models at rest need no side"),
    "pedal_stop.k_stop": chosen(2e6, "rubber"),
    "pedal_stop.tau_stop": chosen(1e-3, "no rebound"),
    "x_pedal": chosen(20 * MM, "80 mm at the foot"),
    "supply.V_bat": chosen(13.0, "12 V system while driving"),
    "supply.R_bat": chosen(8e-3, _NONE),
    "bridge.D_max": chosen(0.95, _CLASS),
    "bridge.f_pwm": chosen(20e3, _CLASS),
    "motor.R_m": chosen(0.025, _NONE),
    "motor.L_m": chosen(50e-6, _NONE),
    "motor.K_e": chosen(0.06, "100 bar with 80 A"),
    "gear.k_g": chosen(5 * MM / (2.0 * math.pi), "screw with a lead of 5 mm, no further gear"),
    "gear.eta_g": chosen(0.9, "ball screw"),
    "gear.law": chosen("directional", "the screw must not generate energy"),
    "gear.J_mot": chosen(1.2e-4, _NONE),
    "gear.M_mc": chosen(0.15, _NONE),
    "seal.T_pr": chosen(0.03, _NONE),
    "seal.f_cfr_p": chosen(8e-9, "2 % of the load"),
    "seal.f_cfr_n": chosen(8e-9, "2 % of the load"),
    "seal.k_brk_p": chosen(1.3, _NONE),
    "seal.k_brk_n": chosen(1.3, _NONE),
    "seal.c": chosen(5.0, _NONE),
    "seal.mu_T": chosen(1e-4, _NONE),
    "plunger.A_mc": chosen(0.25 * math.pi * (26 * MM) ** 2, "26 mm bore"),
    "plunger.s_mc": chosen(45 * MM, "stroke and dead volume"),
    "plunger.x_rest": chosen(1 * MM, _NONE),
    "plunger.x_end": chosen(41 * MM, "21 cm^3"),
    "plunger.x_nominal": chosen(9 * MM, "travel at 100 bar"),
    "plunger.k_damp": chosen(300.0, _NONE),
    "port.law": chosen("dead-stroke", "the plunger has no port after the first millimeter"),
    "port.x_port": chosen(1 * MM, "usual free travel"),
    "port.G_port": chosen(5e-10, "0.5 bar at 50 mm/s"),
    "stop.k_stop": chosen(5e7, "steel on steel"),
    "stop.tau_stop": chosen(2e-4, "no rebound"),
    "line.d": chosen(1.2 * MM, "open inlet valves of three wheels together"),
    "line.C_d": chosen(0.65, "sharp edge"),
    "line.Re_cr": chosen(100.0, _NONE),
    "others.V_1": chosen(0.63 * CM3, "a second front brake and two rear brakes of 40 % each"),
    "others.p_1": chosen(4 * BAR, "same as the wheel"),
    "others.c": chosen(0.0198 * CM3 / BAR, "a second front brake and two rear brakes of 40 % each"),
    **_valve("inlet", 0.5 * MM, "open"),
    **_valve("outlet", 0.6 * MM, "closed"),
    "check.seat.d": chosen(1.2 * MM, _NONE),
    "check.seat.C_d": chosen(0.65, "sharp edge"),
    "check.seat.Re_cr": chosen(100.0, _NONE),
    "check.p_crack": chosen(0.2 * BAR, "light spring"),
    "caliper.V_1": chosen(0.35 * CM3, _NONE),
    "caliper.p_1": chosen(4 * BAR, _NONE),
    "caliper.c": chosen(0.011 * CM3 / BAR, "1.45 cm^3 at 100 bar"),
    "accumulator.p_0": chosen(1.5 * BAR, _NONE),
    "accumulator.k": chosen(1 * BAR / CM3, _NONE),
    "accumulator.V_max": chosen(3.5 * CM3, _NONE),
    "ecu.T_s": chosen(1e-3, "a tenth of the loop"),
    "ecu.T_position": chosen(0.5e-3, "short compared with the loop"),
    "ecu.T_current": chosen(0.2e-3, "short compared with the winding"),
    "ecu.T_coil": derived(lambda par: par.ecu.T_s, "the valves are commanded as often"),
    "ecu.V_ref": chosen(5.0, "usual supply of sensors"),
    "ecu.x_span": derived(lambda par: par.x_pedal, "the whole travel"),
    "ecu.pedal_map.V_nodes": chosen((0.25, 1.0, 2.0, 3.5), "1, 4, 8 and 14 mm at the rod"),
    "ecu.pedal_map.p_nodes": chosen((0.0, 10 * BAR, 40 * BAR, 120 * BAR), _NONE),
    "ecu.pressure.omega_c": chosen(60.0, "10 Hz, a third of the position loop"),
    "ecu.pressure.omega_max": chosen(150.0, "below the speed without load"),
    "ecu.pressure.lead": chosen(3.0, "within the current limit"),
    "ecu.pressure.p_on": chosen(1 * BAR, "released"),
    "ecu.pressure.theta_rest": derived(
        lambda par: (par.plunger.x_rest + 0.2 * MM) / par.gear.k_g, "0.2 mm from the stop"
    ),
    "ecu.pressure.theta_end": derived(
        lambda par: 0.98 * par.plunger.x_end / par.gear.k_g, "before the end stop"
    ),
    "ecu.pressure.A_hat": derived(lambda par: par.plunger.A_mc, _ASSUMED),
    "ecu.pressure.k_hat": derived(lambda par: par.gear.k_g, _ASSUMED),
    "ecu.pressure.brakes.V_1": derived(lambda par: par.caliper.V_1 + par.others.V_1, _ASSUMED),
    "ecu.pressure.brakes.p_1": derived(lambda par: par.caliper.p_1, _ASSUMED),
    "ecu.pressure.brakes.c": derived(lambda par: par.caliper.c + par.others.c, _ASSUMED),
    "ecu.position.f_n": chosen(30.0, "three times the pressure loop"),
    "ecu.position.zeta": chosen(1.0, "no overshoot"),
    "ecu.position.c": chosen(1.0, "the speed of the reference is known"),
    "ecu.position.f_speed": chosen(300.0, "smooths the differences"),
    "ecu.position.i_max": chosen(130.0, "140 bar"),
    "ecu.position.J_hat": derived(lambda par: par.gear.J_mot, _ASSUMED),
    "ecu.position.K_hat": derived(lambda par: par.motor.K_e, _ASSUMED),
    "ecu.current.k_p": derived(
        lambda par: 1500.0 * par.motor.L_m / par.supply.V_bat, "crossover at 1500 rad/s"
    ),
    "ecu.current.k_i": derived(
        lambda par: 1500.0 * par.motor.R_m / par.supply.V_bat, "cancels the pole of the winding"
    ),
    "ecu.current.T_t": derived(lambda par: par.motor.L_m / par.motor.R_m, "integral time"),
    "ecu.current.D_max": chosen(0.95, "same as the bridge"),
}
CORNER = {
    **NUMBERS,
    "disc.faces": chosen(2.0, "one disc"),
    "disc.mu_pad": chosen(0.38, _CLASS),
    "disc.A_cal": chosen(25.5e-4, "one piston of 57 mm"),
    "disc.r_eff": chosen(0.125, "300 mm disc"),
    "disc.T_drag": chosen(0.0, "free pads"),
    "wheel.J": chosen(1.2, "wheel, tire and disc"),
    "wheel.r": chosen(0.30, _CAR),
    "wheel.C_rr": chosen(0.012, "car tire"),
    "corner.body.m": chosen(450.0, _CAR),
    "corner.body.g": chosen(9.81, "gravity"),
    "corner.r": chosen(0.30, _CAR),
    "corner.tyre.curve": chosen("burckhardt", _ROAD),
    "corner.tyre.sigma": chosen(0.20, "about the length of the contact patch"),
    "corner.tyre.c_t": chosen(1.1, "a tenth of critical damping of a vehicle on stuck tires"),
    "corner.tyre.v_low": chosen(2.0, "relaxation damps above this speed"),
    "corner.tyre.tau_slide": chosen(1e-4, "short compared with all vehicle motions"),
    "corner.road.grip": chosen(1.0, "published curve without change"),
    "corner.road.x_change": chosen(1e4, "one surface"),
    "corner.road.x_back": chosen(2e4, "one surface"),
    "corner.road.ramp": chosen(0.01, "one surface"),
    "corner.road.gradient": chosen(0.0, "level road"),
    "corner.road.gradient_further": chosen(0.0, "level road"),
    **{
        f"corner.road.{stretch}.{key}": chosen(value, _ROAD)
        for stretch in ("first", "further")
        for key, value in _STRETCH.items()
    },
    "antilock.T_s": chosen(1e-3, "as fast as the valves"),
    "antilock.abs": chosen("rules", "pulses of the valves need thresholds"),
    "antilock.sees": chosen("estimated", "as on the road"),
    "antilock.M_rate": chosen(2e4, "800 bar/s, as fast as the inlet valve fills the caliper"),
    "antilock.M_least": chosen(0.0, "no air gap"),
    "antilock.tau_a": chosen(0.01, "short compared with the anti-lock cycle"),
    "antilock.encoder.law": chosen("pulses", "as in wheel sensors"),
    "antilock.encoder.pulses": chosen(48.0, "common; some have 100"),
    "antilock.encoder.omega_min": chosen(0.1, "far below walking pace"),
    "antilock.wheel_speed.law": chosen("period", "differences of 48 pulses are too coarse"),
    "antilock.wheel_speed.pulses": chosen(48.0, "same as the sensor"),
    "antilock.vehicle_speed.law": chosen("accelerometer", "the only wheel slips"),
    "antilock.vehicle_speed.a_max": chosen(12.26, "1.25 g"),
    "antilock.vehicle_speed.slip_small": chosen(0.005, "slip of a rolling wheel"),
    "antilock.vehicle_speed.tau": chosen(0.2, "long compared with the first bite"),
    "antilock.vehicle_speed.v_still": chosen(1.0, "edge interval of 40 ms at this speed"),
    "antilock.slip.schedule": chosen("speed", "gain and pole of a wheel fall with its speed"),
    "antilock.slip.slip_set": chosen(0.105, "0.8 times the slip at the peak on wet asphalt"),
    "antilock.slip.omega_c": chosen(20.0, "a third of the valves' bandwidth"),
    "antilock.slip.T_i": chosen(0.2, "four times the time constant of the crossover"),
    "antilock.slip.eager": chosen(0.0, "plain integral"),
    "antilock.slip.T_t": chosen(0.05, "time constant of the crossover"),
    "antilock.slip.v_off": chosen(2.0, "edge interval of 20 ms with 48 pulses"),
    "antilock.slip.v_fall": chosen(6.0, "edge interval of 7 ms with 48 pulses"),
    "antilock.slip.v_fixed": chosen(15.0, "middle of a stop"),
    "antilock.slip.J_hat": derived(lambda par: par.wheel.J, _ASSUMED),
    "antilock.slip.r_hat": derived(lambda par: par.wheel.r, _ASSUMED),
    "antilock.slip.k_hat": derived(lambda par: brake_disc.torque_per_pressure(par.disc), _ASSUMED),
    "antilock.rules.slip_keep": chosen(0.345, "tuned for 10 Hz pressure loops"),
    "antilock.rules.slip_dump": chosen(0.51, "tuned for 10 Hz pressure loops"),
    "antilock.rules.slip_back": chosen(0.224, "tuned for 10 Hz pressure loops"),
    "antilock.rules.t_lead": chosen(0.133, "tuned for 10 Hz pressure loops"),
    "antilock.rules.a_hold": chosen(13.7, "tuned for 10 Hz pressure loops"),
    "antilock.rules.t_hold": chosen(0.0265, "tuned for 10 Hz pressure loops"),
    "antilock.rules.t_most": chosen(0.47, "tuned for 10 Hz pressure loops"),
    "antilock.rules.dump": chosen(100.0, "tuned for 10 Hz pressure loops"),
    "antilock.rules.depth": chosen(0.935, "tuned for 10 Hz pressure loops"),
    "antilock.rules.back": chosen(1.015, "tuned for 10 Hz pressure loops"),
    "antilock.rules.t_step": chosen(0.0183, "tuned for 10 Hz pressure loops"),
    "antilock.rules.step": chosen(0.0425, "tuned for 10 Hz pressure loops"),
    "antilock.rules.growth": chosen(1.12, "tuned for 10 Hz pressure loops"),
    "antilock.rules.tau_a": chosen(0.0055, "tuned for 10 Hz pressure loops"),
    "antilock.rules.tau_p": chosen(0.025, "tuned for 10 Hz pressure loops"),
    "antilock.rules.v_off": chosen(2.0, "same as slip control"),
    "antilock.rules.v_fall": chosen(4.85, "tuned for 10 Hz pressure loops"),
    "antilock.valves.K_in": derived(
        lambda par: orifice.coefficient(par.inlet.seat, par.fluid), _ASSUMED
    ),
    "antilock.valves.K_out": derived(
        lambda par: orifice.coefficient(par.outlet.seat, par.fluid), _ASSUMED
    ),
    "antilock.valves.p_cr": chosen(0.1 * BAR, "small compared with a pulse"),
    "antilock.valves.caliper.V_1": derived(lambda par: par.caliper.V_1, _ASSUMED),
    "antilock.valves.caliper.p_1": derived(lambda par: par.caliper.p_1, _ASSUMED),
    "antilock.valves.caliper.c": derived(lambda par: par.caliper.c, _ASSUMED),
    "antilock.valves.p_low": chosen(2 * BAR, "accumulator with 0.5 cm^3"),
    "antilock.valves.t_least": chosen(2e-3, "longer than the delay of the valves"),
    "antilock.valves.q_pump": chosen(3.3 * CM3, "two pistons at 3000 rpm"),
}
SETS = (
    CitedSet(
        "one-box-front",
        "one-box",
        "our own layout",
        "brake of a mid-size car, with one front wheel in detail",
        OneBoxParameters,
        NUMBERS,
    ),
    CitedSet(
        "one-box-corner",
        "one-box-corner",
        "our own layout; adhesion: values commonly attributed to M. Burckhardt, 1993",
        "front wheel of a mid-size car",
        OneBoxCornerParameters,
        CORNER,
    ),
)
