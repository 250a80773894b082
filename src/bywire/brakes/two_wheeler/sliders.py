"""Parameters at the top of this vehicle's pages: those with the most effect on braking."""

from bywire.report.live_page.sliders import Sliders

SLIDERS = Sliders(
    "two-wheeler",
    ("two-wheeler-by-wire", "two-wheeler-whole-rear"),
    (
        "vehicle.road.grip",
        "vehicle.body.m",
        "vehicle.body.h",
        "front.disc.mu_pad",
        "front.circuit.f_n",
        "ecu.front_slip.slip_set",
    ),
)
