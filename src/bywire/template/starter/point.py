"""Equilibria of the brake starter: clamp forces that the motor holds without friction."""

from __future__ import annotations

import math
from typing import Any

from bywire.template.starter.elements import spindle
from bywire.template.starter.model import Memory, StarterActuator
from bywire.template.starter.parameters import Parameters


def at_force(F: float, par: Parameters) -> tuple[Any, Memory]:
    """Return state and memory in equilibrium at a clamp force [N], without dry friction."""
    c = par.caliper
    s = 0.5 * c.x_stiff * (math.sqrt(1.0 + 4.0 * F / (c.k * c.x_stiff)) - 1.0)
    theta = (c.x_gap + s) / par.spindle.r
    i = par.spindle.r * F / par.motor.K_e
    v = par.motor.R_m * i
    state = StarterActuator.state(
        motor=StarterActuator.parts["motor"].element.State(i), spindle=spindle.State(theta, 0.0)
    )
    return state, Memory(v=v, v_i=v)
