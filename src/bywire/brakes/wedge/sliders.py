"""Parameters with the most effect on braking, shown at the top of this brake's pages."""

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
