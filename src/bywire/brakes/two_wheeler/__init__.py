"""A two-wheeler with brakes by wire, each modeled by its pressure loop alone."""

from bywire.core.brake import Brake

BRAKE = Brake(
    "two-wheeler", "motorcycle with two brakes by wire, on any surface, slip control", __name__
)
