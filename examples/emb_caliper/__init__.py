"""An electro-mechanical disc brake for cars, as your own actuator outside bywire.

Motor, planetary gear and ball screw press the pads of a floating caliper together. Force, speed
and current control form a cascade. See the README next to this file.
"""

from bywire.authoring import Brake

BRAKE = Brake(
    "emb-caliper", "motor, planetary gear, ball screw, floating caliper, cascaded control", __name__
)
