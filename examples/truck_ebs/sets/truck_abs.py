"""The same front wheel with an anti-lock system, chosen."""

from __future__ import annotations

from bywire.authoring import CitedSet, chosen, derived
from truck_ebs.parameters import AbsTruckParameters
from truck_ebs.sets.truck import NUMBERS, ORIFICE

_RULES = "tuned on this brake, on dry asphalt, wet cobble and snow"
_SENSOR = "common at trucks"
ABS_NUMBERS = {
    **NUMBERS,
    "V_hose": chosen(0.15e-3, "1 m of hose and the valves, no source"),
    "chamber.V_0": chosen(0.40e-3, "the remaining dead volume; the hose is in V_hose"),
    "modulator.tau_hold": chosen(8e-3, "5 to 15 ms for diaphragm valves"),
    "modulator.tau_vent": chosen(8e-3, "5 to 15 ms for diaphragm valves"),
    **{f"passage.{key}": value for key, value in ORIFICE.items()},
    "passage.C": chosen(8e-8, "wide, so that it hardly delays braking without anti-lock control"),
    **{f"bleed.{key}": value for key, value in ORIFICE.items()},
    "switch.band": chosen(0.08e5, "no source"),
    "switch.t_lead": chosen(12e-3, "delay of the valves, and half a sample"),
    "slip.T_s": chosen(5e-3, "same as pressure control"),
    "slip.abs": chosen("rules", "as in series"),
    "slip.sees": chosen("estimated", "as on the road"),
    "slip.M_rate": chosen(8e4, "faster than the valves"),
    "slip.M_least": chosen(500.0, "keeps the pads on the disc"),
    "slip.tau_a": chosen(0.01, "short compared with the pressure's response"),
    "slip.encoder.law": chosen("pulses", "like real wheel sensors"),
    "slip.encoder.pulses": chosen(100.0, _SENSOR),
    "slip.encoder.omega_min": chosen(0.1, "far below walking pace"),
    "slip.wheel_speed.law": chosen("period", "differences of pulses are too coarse"),
    "slip.wheel_speed.pulses": chosen(100.0, "same as the sensor"),
    "slip.vehicle_speed.law": chosen("accelerometer", "the only wheel slips"),
    "slip.vehicle_speed.a_max": chosen(9.81, "1 g"),
    "slip.vehicle_speed.slip_small": chosen(0.005, "slip of a rolling wheel"),
    "slip.vehicle_speed.tau": chosen(0.2, "long compared with the first bite"),
    "slip.vehicle_speed.v_still": chosen(1.0, "walking pace"),
    "slip.slip.schedule": chosen("speed", "gain and pole of a wheel fall with its speed"),
    "slip.slip.slip_set": chosen(0.12, "below the peak on dry asphalt"),
    "slip.slip.omega_c": chosen(4.0, "a third of the bandwidth of the valves"),
    "slip.slip.T_i": chosen(1.0, "four times the time constant of the crossover"),
    "slip.slip.eager": chosen(3.0, "no source"),
    "slip.slip.T_t": chosen(0.25, "time constant of the crossover"),
    "slip.slip.v_off": chosen(2.0, "usual for anti-lock systems"),
    "slip.slip.v_fall": chosen(6.0, "edges are slow below"),
    "slip.slip.v_fixed": chosen(15.0, "middle of a stop"),
    "slip.slip.J_hat": derived(lambda par: par.wheel.J, "same as the wheel"),
    "slip.slip.r_hat": derived(lambda par: par.corner.r, "same as the wheel"),
    "slip.slip.k_hat": derived(
        lambda par: 2.0 * par.disc.mu * par.disc.r_eff * par.lever.i * par.chamber.A_table[0],
        "torque per pressure of disc, lever and chamber",
    ),
    "slip.rules.slip_keep": chosen(0.19, _RULES),
    "slip.rules.slip_dump": chosen(0.46, _RULES),
    "slip.rules.slip_back": chosen(0.054, _RULES),
    "slip.rules.t_lead": chosen(0.276, _RULES),
    "slip.rules.a_hold": chosen(3.2, _RULES),
    "slip.rules.t_hold": chosen(0.05, _RULES),
    "slip.rules.t_most": chosen(0.86, _RULES),
    "slip.rules.dump": chosen(90.0, _RULES),
    "slip.rules.depth": chosen(0.78, _RULES),
    "slip.rules.back": chosen(1.018, _RULES),
    "slip.rules.t_step": chosen(0.117, _RULES),
    "slip.rules.step": chosen(0.058, _RULES),
    "slip.rules.growth": chosen(1.0, _RULES),
    "slip.rules.tau_a": chosen(0.019, _RULES),
    "slip.rules.tau_p": chosen(0.02, _RULES),
    "slip.rules.v_off": chosen(2.0, _RULES),
    "slip.rules.v_fall": chosen(4.0, _RULES),
}
SET = CitedSet(
    "truck-front-abs",
    "truck-abs",
    "our own layout",
    "a front wheel of a truck with an anti-lock system",
    AbsTruckParameters,
    ABS_NUMBERS,
)
