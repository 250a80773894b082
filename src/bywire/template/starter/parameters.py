"""Parameters of the brake starter, by part."""

from __future__ import annotations

from bywire.authoring import Duration, ParameterSet
from bywire.plant import dc_motor
from bywire.template.starter.elements import caliper_spring, spindle
from bywire.template.starter.laws import force_control


class Parameters(ParameterSet):
    """All parameters; bywire checks the unit and range of each."""

    motor: dc_motor.Parameters
    spindle: spindle.Parameters
    caliper: caliper_spring.Parameters
    control: force_control.Parameters
    T_s: Duration
    """sample time of the force control"""
