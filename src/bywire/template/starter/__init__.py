"""The brake starter: DC motor, planetary gear and ball screw, caliper spring, force control."""

from bywire.authoring import Brake

BRAKE = Brake("starter", "DC motor, spindle with dry friction, caliper, force control", __name__)
