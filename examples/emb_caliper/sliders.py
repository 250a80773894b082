"""Parameters at the top of this brake's pages: those with the most effect on braking."""

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
