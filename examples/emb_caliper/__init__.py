"""An electro-mechanical disc brake for cars: an actuator of one's own, written outside bywire.

Motor, planetary gear and ball screw press the pads of a floating caliper together; force, speed
and current are controlled in a cascade. See the README beside this file.
"""

from bywire.authoring import Brake

BRAKE = Brake(
    "emb-caliper", "motor, planetary gear, ball screw, floating caliper, cascaded control", __name__
)
