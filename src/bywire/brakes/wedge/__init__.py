"""The wedge brake of Roberts et al. (2003), and the rigs of its drive train."""

from bywire.core.brake import Brake

BRAKE = Brake(
    "wedge", "two motors with roller screws, brake heart, wedge, caliper, and test rigs", __name__
)
