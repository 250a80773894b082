"""Parameters that stand first in pages of this brake: those that say most of how it brakes."""

from bywire.authoring import Sliders

SLIDERS = Sliders(
    "emb-caliper",
    ("emb-caliper",),
    (
        "screw.lead",
        "friction.C",
        "motor.R_m",
        "caliper.k_1",
        "caliper.clearance",
        "ecu.force.k_p",
    ),
)
