"""A one-box electrohydraulic brake with anti-lock valves at a wheel, as your own actuator.

A motor and a screw push a plunger, which sets the pressure of all brakes. At one wheel, an inlet
and an outlet valve, an accumulator and a return pump lower the pressure. See the README next to
this file.
"""

from bywire.authoring import Brake

BRAKE = Brake(
    "one-box", "plunger, anti-lock valves, return pump and pedal simulator, at a wheel", __name__
)
