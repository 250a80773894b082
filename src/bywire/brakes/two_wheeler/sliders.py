"""Parameters that stand first in pages of this brake: those that say most of how it brakes."""

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
