"""Parameters at the top of this brake's pages, with the most effect on braking."""

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
