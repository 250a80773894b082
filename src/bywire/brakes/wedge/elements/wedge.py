"""Wedge, which the screws move, the pad friction pulls in, and the slope pushes out."""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

from pydantic import Field

from bywire.core import ops
from bywire.core.faults import ParameterFault
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Gain, Length, Mass, Unit
from bywire.core.signals import Energy, Power, Signal

WedgeAngle = Annotated[float, Unit("rad", 0.35), Field(gt=0, lt=0.5 * math.pi, allow_inf_nan=False)]
SpringRate = Annotated[float, Unit("N/m", 1e4), Field(ge=0, allow_inf_nan=False)]


class Parameters(ParameterSet):
    """Symmetric wedge on rollers. Positive travel brakes positive disc rotation."""

    alpha: WedgeAngle
    """wedge angle"""
    M_W: Mass
    """mass of the moving wedge and pad"""
    mu_B: Gain
    """coefficient of friction between pads and disc"""
    k_return: SpringRate
    """stiffness of the spring that centers the wedge; 0 without a spring"""
    x_stop: Length
    """wedge travel to the end stop on either side"""


FAULTS = (
    ParameterFault("friction", "different pad friction: wet, hot, glazed", ("mu_B",), 1.5),
    ParameterFault("spring-broken", "return spring broken", ("k_return",), 0.0),
)


class State(NamedTuple):
    """Travel and velocity, zero in the middle."""

    x: Annotated[float, Signal("m", "wedge travel", 1e-3)]
    v: Annotated[float, Signal("m/s", "wedge velocity", 0.02)]


class Factors(NamedTuple):
    """Factors of the derivatives."""

    x: Annotated[float, Signal("1", "unity")]
    v: Annotated[float, Signal("kg", "mass", 0.6)]


class Balance(NamedTuple):
    """Right-hand sides of travel and velocity."""

    x: Annotated[float, Signal("m/s", "wedge velocity", 0.02)]
    v: Annotated[float, Signal("N", "accelerating force", 100.0)]


class Input(NamedTuple):
    """Forces on the wedge, the wedge's side, and the disc direction."""

    F_M: Annotated[float, Signal("N", "actuation force", 400.0)]
    F_N: Annotated[float, Signal("N", "normal force", 3e3)]
    F_stop: Annotated[float, Signal("N", "force on the end stops", 100.0)]
    friction: Annotated[float, Signal("N", "friction force", 50.0)]
    side: Annotated[float, Signal("1", "side of the wedge, +1 or -1")]
    turning: Annotated[float, Signal("1", "disc direction, 0 when stopped")]


def slope(par: Parameters) -> Annotated[float, Signal("1", "slope of the wedge", 0.4)]:
    """Return the tangent of the wedge angle."""
    return ops.sin(par.alpha) / ops.cos(par.alpha)


def side(x: State) -> Annotated[float, Signal("1", "side of the wedge")]:
    """Return +1 for travel >= 0, otherwise -1."""
    return ops.where(x.x < 0, -1.0, 1.0)


def mass(par: Parameters) -> Factors:
    """Return the factors of the derivatives: 1 and the mass."""
    return Factors(x=1.0, v=par.M_W)


def balance(x: State, u: Input, par: Parameters) -> Balance:
    r"""Return velocity and force.

    .. math::
        M_W \ddot x = F_M + (\mu_B s(\Omega) - \mathrm{sgn}(x) \tan\alpha) F_N
        - k x - F_{stop} + F_{FRICT}

    References
    ----------
    Roberts et al. (2003), section "Wedge and calliper". Our copy prints mu_R for the pad.
    """
    self_reinforcing = (par.mu_B * u.turning - u.side * slope(par)) * u.F_N
    force = u.F_M + self_reinforcing - par.k_return * x.x - u.F_stop + u.friction
    return Balance(x=x.v, v=force)


def pad_power(x: State, u: Input, par: Parameters) -> Power:
    """Return the power of the disc on the wedge, which is the self-reinforcement."""
    return par.mu_B * u.turning * u.F_N * x.v


def energy(x: State, par: Parameters) -> Energy:
    """Return the kinetic energy and the energy of the return spring."""
    return 0.5 * par.M_W * x.v * x.v + 0.5 * par.k_return * x.x * x.x


def power_in(x: State, u: Input, par: Parameters) -> Power:
    """Return the power of all forces on the wedge except the return spring."""
    against = u.side * slope(par) * u.F_N + u.F_stop
    return (u.F_M + u.friction - against) * x.v + pad_power(x, u, par)
