"""A two-wheeler with brakes by wire, each modeled only by its pressure loop."""

from bywire.core.brake import Brake

BRAKE = Brake(
    "two-wheeler", "motorcycle with two by-wire brakes and slip control, on any surface", __name__
)
