"""Parameters that stand first in pages of this brake: those that say most of how it brakes."""

from bywire.report.live_page.sliders import Sliders

SLIDERS = Sliders(
    "motorcycle",
    ("motorcycle-brake",),
    (
        "seal.T_pr",
        "motor.R_m",
        "caliper.K_pd",
        "fluid.beta",
        "ecu.pressure.k_p",
        "ecu.dither.gain",
    ),
)
