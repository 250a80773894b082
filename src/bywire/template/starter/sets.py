"""Parameter sets of the brake starter: every value with its source."""

from __future__ import annotations

from bywire.authoring import CitedSet, chosen, derived
from bywire.template.starter.parameters import Parameters

_MOTOR = "a motor of about 200 W at 12 V"
_TUNED = "tuned by hand. 'bywire margins starter-force' shows the margins"

ENTRIES = (
    CitedSet(
        name="starter-example",
        assembly="starter-actuator",
        source="invented, with the magnitudes of a car's brake. Cite your source here",
        summary="an example of 20 kN. Replace every number with your own",
        parameter_class=Parameters,
        values={
            "motor.R_m": chosen(0.1, _MOTOR),
            "motor.L_m": chosen(1e-4, _MOTOR),
            "motor.K_e": chosen(0.05, _MOTOR),
            "spindle.J": chosen(2e-4, "rotor and gear"),
            "spindle.r": derived(2.65e-5, "lead of 4 mm over 2 pi, planetary gear of 24"),
            "spindle.d": chosen(1e-4, "grease; small compared with the dry friction"),
            "spindle.T_0": chosen(0.02, "measure it from the motor's current without clamp force"),
            "spindle.c_F": chosen(4e-6, "15 % of the load torque r F"),
            "caliper.x_gap": chosen(3e-4, "clearance of both pads"),
            "caliper.k": chosen(2e7, "a floating caliper"),
            "caliper.x_stiff": chosen(1e-3, "a floating caliper"),
            "control.k_F": chosen(0.03, _TUNED),
            "control.omega_max": chosen(200.0, "below the no-load speed at 12 V"),
            "control.k_p": chosen(0.06, _TUNED),
            "control.k_i": chosen(1.5, _TUNED),
            "control.v_max": chosen(12.0, "supply"),
            "T_s": chosen(1e-3, "a typical ECU task"),
        },
    ),
)
