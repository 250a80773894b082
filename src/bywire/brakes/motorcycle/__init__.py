"""The motorcycle brake of Dardanelli et al. (2010): an electro-mechanical master cylinder."""

from bywire.core.brake import Brake

BRAKE = Brake(
    "motorcycle", "DC motor, ball screw, master cylinder, pipeline, caliper, ECU", __name__
)
