"""Rack and pinion, which convert rotation to travel and force to torque."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from bywire.core import ops
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Fraction, Length
from bywire.core.signals import Power, Signal


class Parameters(ParameterSet):
    """Rigid and massless, with tooth friction proportional to the load."""

    r_p: Length
    """pitch radius of the pinion"""
    eta: Fraction
    """efficiency when the pinion drives"""


class Input(NamedTuple):
    """Motion of the pinion, and the opposing force at the rack."""

    theta: Annotated[float, Signal("rad", "pinion angle", 1.0)]
    omega: Annotated[float, Signal("rad/s", "pinion speed", 5.0)]
    force: Annotated[float, Signal("N", "load on the rack", 500.0)]


class Output(NamedTuple):
    """Travel and speed of the rack, and torque on the pinion, without friction."""

    x: Annotated[float, Signal("m", "travel of the rack", 0.01)]
    v: Annotated[float, Signal("m/s", "speed of the rack", 0.05)]
    load: Annotated[float, Signal("N*m", "load on the pinion", 5.0)]


def output(u: Input, par: Parameters) -> Output:
    r"""Return the motion of the rack, and the load on the pinion, :math:`T = r_p F`."""
    return Output(x=par.r_p * u.theta, v=par.r_p * u.omega, load=par.r_p * u.force)


def friction(u: Input, par: Parameters) -> Annotated[float, Signal("N*m", "rack friction", 0.5)]:
    r"""Return the magnitude of the friction torque on the pinion, for set-valued friction.

    .. math:: T = (1/\eta - 1) r_p |F|

    in both directions. The back-driven efficiency is 2 - 1/eta, and the rack holds at rest.
    """
    return (1.0 / par.eta - 1.0) * ops.fabs(output(u, par).load)


def power_loss(u: Input, par: Parameters) -> Power:
    """Return the heat from sliding teeth, >= 0."""
    return friction(u, par) * ops.fabs(u.omega)
