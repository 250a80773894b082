"""An electronically controlled air brake at a wheel of a truck, as your own actuator.

The ECU sets the control pressure of a relay valve, which feeds a brake chamber from the reservoir.
Its push rod turns a lever, which presses the pads of a disc brake. See the README next to this
file.
"""

from bywire.authoring import Brake

BRAKE = Brake("truck-ebs", "relay valve, brake chamber, lever and disc at a truck wheel", __name__)
