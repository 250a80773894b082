"""Pedal simulator, whose two springs give the driver the feel of a hydraulic brake."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from pydantic import Field

from bywire.core import ops
from bywire.core.faults import ParameterFault
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Length, Stiffness, Unit
from bywire.core.signals import Energy, Power, Role, Signal

DampingPerDirection = Annotated[float, Unit("N*s/m", 200.0), Field(ge=0, allow_inf_nan=False)]
Loss = Annotated[float, Signal("W", "damping loss", role=Role("sink", "pedal damping"))]


class Parameters(ParameterSet):
    """Massless piston. The second spring touches at ``x_1``."""

    k_1: Stiffness
    """stiffness of the first spring"""
    k_2: Stiffness
    """stiffness that the second spring adds"""
    x_1: Length
    """travel at which the second spring touches"""
    d_in: DampingPerDirection
    """damping while the pedal is pressed"""
    d_out: DampingPerDirection
    """damping while the pedal returns"""


FAULTS = (ParameterFault("broken", "broken second spring", ("k_2",), 0.01),)


class Input(NamedTuple):
    """Travel and speed of the piston."""

    x: Annotated[float, Signal("m", "travel of the pedal simulator", 0.01)]
    v: Annotated[float, Signal("m/s", "speed of the pedal simulator", 0.1)]


class InputRate(NamedTuple):
    """Derivative of the input that affects the stored energy."""

    x: Annotated[float, Signal("m/s", "speed of the pedal simulator", 0.1)]


def spring_force(u: Input, par: Parameters) -> Annotated[float, Signal("N", "spring force", 200.0)]:
    r"""Return the force of the springs, :math:`k_1 x + k_2 \max(x - x_1, 0)`.

    It has a kink where the second spring touches.
    """
    return par.k_1 * u.x + par.k_2 * ops.fmax(u.x - par.x_1, 0.0)


def force(u: Input, par: Parameters) -> Annotated[float, Signal("N", "pedal force", 200.0)]:
    """Return the force against the driver, with damping that differs by direction."""
    return spring_force(u, par) + ops.where(u.v > 0, par.d_in, par.d_out) * u.v


def input_rate(u: Input) -> InputRate:
    """Return the speed, through which the springs store energy."""
    return InputRate(x=u.v)


def energy(u: Input, par: Parameters) -> Energy:
    """Return the energy of the springs."""
    beyond = ops.fmax(u.x - par.x_1, 0.0)
    return 0.5 * (par.k_1 * u.x * u.x + par.k_2 * beyond * beyond)


def power_in(u: Input, par: Parameters) -> Power:
    """Return the power of the driver's foot."""
    return force(u, par) * u.v


def power_loss(u: Input, par: Parameters) -> Loss:
    """Return the loss of the damping, >= 0."""
    return (force(u, par) - spring_force(u, par)) * u.v
