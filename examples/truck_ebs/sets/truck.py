"""A front wheel of a truck with 80 km/h, chosen; chamber and gas as in common data sheets."""

from __future__ import annotations

from bywire.authoring import CitedSet, chosen, derived
from truck_ebs.parameters import TruckParameters

_ISO = "reference state of ISO 8778"
_CLASS = "a disc brake of this class"
_ROAD = "dry asphalt, Burckhardt's values for a car tire"
_STRETCH = {"c1": 1.2801, "c2": 23.99, "c3": 0.52, "B": 10.0, "C": 1.9, "D": 1.0, "E": 0.97}
ORIFICE = {
    "C": chosen(4e-8, "no source"),
    "b": chosen(0.3, "no source"),
    "r_lam": chosen(0.999, "the default of Simscape's orifice"),
}
"""values of an orifice"""
NUMBERS = {
    "gas.p_ref": chosen(1e5, _ISO),
    "gas.rho_0": chosen(1.185, _ISO),
    "gas.T_0": chosen(293.15, _ISO),
    "gas.gamma": chosen(1.4, "air"),
    "gas.p_atm": chosen(101_325.0, "standard atmosphere"),
    "p_s": chosen(8.5e5, "usual cut-in pressure of a reservoir"),
    "relay.law": chosen("lag", "without hysteresis"),
    "relay.tau": chosen(12e-3, "no source"),
    "relay.overlap": chosen(0.05, "no source"),
    "relay.p_full": chosen(0.3e5, "no source"),
    "relay.a": chosen(1.0, "output pressure equals control pressure (law mechanical)"),
    "relay.p_crack": chosen(0.1e5, "no source (law mechanical)"),
    "relay.p_fr": chosen(0.04e5, "no source (law mechanical)"),
    **{f"feed.{key}": value for key, value in ORIFICE.items()},
    **{f"exhaust.{key}": value for key, value in ORIFICE.items()},
    "volume.law": chosen("isothermal", "the metal of chamber and hose holds the temperature"),
    "volume.G_w": chosen(10.0, "no source (law heat)"),
    "chamber.V_0": chosen(0.55e-3, "no source, with the hose"),
    "chamber.x_table": chosen((0.0, 0.043, 0.064), "the area falls over the last third"),
    "chamber.A_table": chosen((0.014, 0.014, 0.009), "140 cm^2, about type 22"),
    "chamber.F_s0": chosen(420.0, "no source"),
    "chamber.k_s": chosen(8e3, "no source"),
    "chamber.G_leak": chosen(0.0, "tight"),
    "rod.m": chosen(1.5, "rod, diaphragm and lever"),
    "rod.d": chosen(200.0, "little"),
    "lever.law": chosen("constant", "the eccentric of a disc brake hardly changes its ratio"),
    "lever.i": chosen(15.0, _CLASS),
    "lever.L": chosen(0.08, "no source (law turning)"),
    "lever.phi_0": chosen(0.25, "perpendicular in the middle of the stroke (law turning)"),
    "lever.F_fr": chosen(60.0, "about 1 % of the force"),
    "lever.mu": chosen(0.04, "efficiency of about 0.96, no source"),
    "caliper.k_1": chosen(4e7, _CLASS),
    "caliper.k_2": derived(
        lambda par: par.caliper.k_1 / 2e-3, "stiffness doubles within 2 mm of compression"
    ),
    "caliper.k_3": chosen(0.0, "no source"),
    "caliper.n_max": chosen(3e-3, "beyond the largest clamp force"),
    "caliper.tau": chosen(2e-4, "no rebound"),
    "caliper.clearance": chosen(8e-4, _CLASS),
    "stop.k_stop": chosen(2e7, "steel on steel"),
    "stop.tau_stop": chosen(2e-4, "no rebound"),
    "disc.mu": chosen(0.35, _CLASS),
    "disc.r_eff": chosen(0.165, _CLASS),
    "wheel.J": chosen(12.0, "twin tires not included"),
    "wheel.r": chosen(0.5, "295/80 R22.5"),
    "wheel.C_rr": chosen(0.006, "truck tire"),
    "corner.body.m": chosen(3500.0, "front axle load of 7 t"),
    "corner.body.g": chosen(9.81, "gravity"),
    "corner.r": chosen(0.5, "295/80 R22.5"),
    "corner.tyre.curve": chosen("burckhardt", _ROAD),
    "corner.tyre.sigma": chosen(0.3, "truck tire, about the length of its contact patch"),
    "corner.tyre.c_t": chosen(1.1, "a tenth of critical damping of a vehicle on stuck tires"),
    "corner.tyre.v_low": chosen(2.0, "relaxation damps above this speed"),
    "corner.tyre.tau_slide": chosen(1e-4, "short compared with all vehicle motions"),
    "corner.road.grip": chosen(0.8, "a truck tire has less grip than a car tire"),
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
    "ecu.control": chosen("closed-loop", "as the name of the system says"),
    "ecu.T_s": chosen(5e-3, "no source"),
    "ecu.T_bus": chosen(20e-3, "bus, electronics and pilot valve, no source"),
    "ecu.p_max": chosen(8.5e5, "pressure of the reservoir"),
    "ecu.p_range": chosen(12e5, "above the reservoir's largest pressure"),
    "ecu.filter.f_aa": chosen(80.0, "below half the sampling rate of 200 Hz"),
    "ecu.pressure.touching.k_i": chosen(10.0, "phase margin of 69 degrees at 3 bar"),
    "ecu.pressure.gap.k_i": chosen(7.0, "phase margin of 69 degrees at 0.34 bar"),
    "ecu.pressure.p_touch": chosen(0.4e5, "the pads touch at 0.37 bar"),
    "ecu.pressure.p_blend": chosen(0.1e5, "narrow"),
    "ecu.pressure.p_dead": chosen(0.03e5, "0.4 % of the largest pressure"),
    "ecu.pressure.p_wait": chosen(0.5e5, "the relay valve is then fully open"),
    "ecu.pressure.p_trim": chosen(0.5e5, "five times the crack pressure of the relay valve"),
}
SET = CitedSet(
    "truck-front",
    "truck-ebs",
    "our own layout",
    "a front wheel of a truck",
    TruckParameters,
    NUMBERS,
)
