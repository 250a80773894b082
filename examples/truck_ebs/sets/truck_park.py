"""A rear wheel of a truck with spring brake, tank and compressor, chosen."""

from __future__ import annotations

from bywire.authoring import CitedSet, chosen
from truck_ebs.parameters import ParkTruckParameters
from truck_ebs.sets.truck import NUMBERS, ORIFICE

_STEEL = {"k_stop": chosen(2e7, "steel on steel"), "tau_stop": chosen(2e-4, "no rebound")}
PARK_NUMBERS = {
    **NUMBERS,
    "p_s": chosen(8.5e5, "between cut-in and cut-out"),
    "V_tank": chosen(20e-3, "a tank of 40 l serves two wheels"),
    "compressor.V_dot": chosen(2.5e-3, "300 l/min for two wheels"),
    "compressor.c": chosen(0.04, "usual for piston compressors"),
    "governor.T_s": chosen(10e-3, "short compared with the tank's pressure"),
    "governor.p_in": chosen(8.1e5, "usual"),
    "governor.p_out": chosen(9.3e5, "usual"),
    **{f"burst.{key}": value for key, value in ORIFICE.items()},
    "burst.C": chosen(4e-8, "a hole of about 5 mm"),
    **{f"hand_valve.{key}": value for key, value in ORIFICE.items()},
    "hand_valve.C": chosen(4e-8, "with a quick-release valve at the park chamber"),
    "spring.A": chosen(0.0194, "30 square inches"),
    "spring.V_0": chosen(0.3e-3, "no source, with the hose"),
    "spring.x_max": chosen(0.06, "below the stroke of the chamber"),
    "spring.F_s0": chosen(9.9e3, "retracts at 5.1 bar"),
    "spring.k_s": chosen(85e3, "7 kN at half of the stroke"),
    "spring.m": chosen(3.0, "piston and rod"),
    "spring.d": chosen(500.0, "little"),
    "spring.F_fr": chosen(150.0, "about 2 % of the force"),
    **{f"{stop}.{key}": value for stop in ("push", "ends") for key, value in _STEEL.items()},
    "corner.body.m": chosen(9000.0, "half of a truck of 18 t, which two wheels park"),
}
SET = CitedSet(
    "truck-rear-park",
    "truck-park",
    "our own layout",
    "a rear wheel of a truck with spring brake, which parks half of the vehicle",
    ParkTruckParameters,
    PARK_NUMBERS,
)
