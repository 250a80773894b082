"""A two-wheeler whose brakes by wire are known by the loop of their pressure alone."""

from bywire.core.brake import Brake

BRAKE = Brake(
    "two-wheeler", "motorcycle with two brakes by wire, on any surface, slip control", __name__
)
