"""Ball ramp, in which balls between inclined tracks convert rotation to travel."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from pydantic import Field

from bywire.core import ops
from bywire.core.faults import ParameterFault
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Length, Unit, Weight
from bywire.core.signals import Power, Signal, Torque

RampAngle = Annotated[float, Unit("rad", 0.05), Field(gt=0, lt=1.5, allow_inf_nan=False)]


class Parameters(ParameterSet):
    """Massless ramp with constant slope. All balls share the load equally."""

    r: Length
    """track radius"""
    alpha: RampAngle
    """ramp angle"""
    mu: Weight
    """friction coefficient of the rolling balls"""


FAULTS = (ParameterFault("worn", "rougher tracks", ("mu",), 3.0),)


class Input(NamedTuple):
    """Axial force on the ramp, positive toward clamping, and angular speed."""

    force: Annotated[float, Signal("N", "axial force on the ramp", 1e4)]
    omega: Annotated[float, Signal("rad/s", "speed of the ramp", 1.0)]


def slope(par: Parameters) -> Annotated[float, Signal("m/rad", "travel per angle", 1e-3)]:
    r"""Return the travel per angle, :math:`dx/d\varphi = r \tan\alpha`."""
    return par.r * ops.sin(par.alpha) / ops.cos(par.alpha)


def load_torque(u: Input, par: Parameters) -> Torque:
    r"""Return the torque of the axial force without friction, :math:`T = F r \tan\alpha`."""
    return slope(par) * u.force


def friction(u: Input, par: Parameters) -> Torque:
    r"""Return the magnitude of the friction torque, which is set-valued at rest.

    .. math:: T_{fr} = \mu |F| r
    """
    return par.mu * par.r * ops.fabs(u.force)


def power_loss(u: Input, par: Parameters) -> Power:
    """Return the friction heat, >= 0."""
    return friction(u, par) * ops.fabs(u.omega)
