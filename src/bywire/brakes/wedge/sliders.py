"""Parameters that stand first in pages of this brake: those that say most of how it brakes."""

from bywire.report.live_page.sliders import Sliders

SLIDERS = Sliders(
    "wedge",
    ("wedge-brake",),
    (
        "wedge.mu_B",
        "wedge.alpha",
        "caliper.K_cal",
        "caliper.clearance",
        "heart.K_W",
        "control.moment.f_c",
    ),
)
