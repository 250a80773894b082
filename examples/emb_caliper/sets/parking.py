"""Parking brakes of the caliper: a self-locking screw, or a screw with little friction and a pawl.

No public source gives a complete set. All values are chosen for a brake of this size, except those
of the caliper, which are the same as in ``emb42v``.
"""

from __future__ import annotations

import math

from bywire.authoring import CitedSet, chosen
from emb_caliper.models.parking import Parameters
from emb_caliper.sets.emb42v import CASCADE

_SIZE = "a motor of this size"
_CALIPER = {k: v for k, v in CASCADE.values.items() if k.startswith("caliper.")}
_COMMON = _CALIPER | {
    "supply.V_bat": chosen(12.0, "battery of a car"),
    "supply.R_bat": chosen(0.03, "battery and leads"),
    "bridge.D_max": chosen(1.0, "the motor gets the whole voltage"),
    "bridge.f_pwm": chosen(20e3, "for information only"),
    "motor.R_m": chosen(0.3, _SIZE),
    "motor.L_m": chosen(0.2e-3, _SIZE),
    "motor.K_e": chosen(0.02, _SIZE),
    "shaft.J": chosen(1e-5, "rotor and gear"),
    "shaft.d": chosen(5e-6, _SIZE),
    "T_fr": chosen(0.02, "brushes, bearings and gear"),
    "gear.z_sun_1": chosen(12.0, "49 in two equal stages"),
    "gear.z_ring_1": chosen(72.0, "49 in two equal stages"),
    "gear.z_sun_2": chosen(12.0, "49 in two equal stages"),
    "gear.z_ring_2": chosen(72.0, "49 in two equal stages"),
    "disc.alpha": chosen(1.2e-5, "gray cast iron"),
    "disc.length": chosen(24e-3, "thickness of a ventilated disc"),
    "disc.tau": chosen(600.0, "a disc at rest"),
    "disc.T_a": chosen(293.15, "20 degC"),
    "parking.law": chosen("force", "measured or estimated force"),
    "parking.F_park": chosen(20e3, "a clamp force for a grade of 30 %"),
    "parking.F_again": chosen(19.5e3, "2.5 % less"),
    "parking.i_park": chosen(18.0, "about 20 kN with the self-locking screw"),
    "parking.t_inrush": chosen(0.1, "the motor reaches its speed"),
    "parking.t_again": chosen(180.0, "three minutes"),
    "parking.again": chosen(4.0, "until the disc is cold"),
    "parking.t_unlock": chosen(0.02, "an unloaded pawl moves in 10 ms"),
    "parking.t_rest": chosen(0.2, "the motor comes to rest"),
    "parking.theta_open": chosen(0.0, "the parked piston"),
    "T_s": chosen(5e-3, "a body controller"),
    "pawl.delta": chosen(2.0 * math.pi / 24.0, "24 teeth"),
    "pawl.r": chosen(10e-3, "ratchet on the motor shaft"),
    "pawl.k": chosen(50.0, "stiff compared with the caliper at the motor shaft"),
    "pawl.tau": chosen(1e-3, "a small solenoid"),
    "pawl.mu": chosen(0.15, "greased steel"),
    "pawl.F_spring": chosen(3.0, "holds the pawl against vibration"),
    "pawl.F_sol": chosen(5.0, "more than the spring, less than a loaded tooth needs"),
}

SCREW = CitedSet(
    name="parking-screw",
    assembly="emb-parking",
    source="chosen values",
    summary="parking brake with a self-locking screw",
    parameter_class=Parameters,
    values=_COMMON
    | {
        "screw.lead": chosen(2e-3, "self-locking"),
        "screw.d_m": chosen(10e-3, "a spindle for 20 kN"),
        "screw.mu": chosen(0.12, "greased steel"),
        "screw.beta": chosen(math.radians(15.0), "trapezoidal thread"),
        "pawl.law": chosen("off", "the screw locks itself"),
        "parking.lock": chosen("screw", "the screw locks itself"),
    },
)
PAWL = CitedSet(
    name="parking-pawl",
    assembly="emb-parking",
    source="chosen values",
    summary="parking brake with a ball screw and a pawl on the motor shaft",
    parameter_class=Parameters,
    values=_COMMON
    | {
        "screw.lead": chosen(5e-3, "as in emb42v"),
        "screw.d_m": chosen(12e-3, "a ball screw for 20 kN"),
        "screw.mu": chosen(0.01, "rolling friction"),
        "screw.beta": chosen(math.radians(15.0), "equivalent flank angle"),
        "pawl.law": chosen("mono-stable", "holds without current"),
        "parking.lock": chosen("mono-stable", "as the pawl"),
    },
)
