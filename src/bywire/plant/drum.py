"""Drum brake with internal shoes: leading shoes, trailing shoes, and shoes in series."""

from __future__ import annotations

import math
from typing import Annotated, Literal, NamedTuple

from pydantic import Field, model_validator

from bywire.core import ops
from bywire.core.faults import ParameterFault
from bywire.core.parameters import ParameterSet, RuleError
from bywire.core.quantities import Length, Unit
from bywire.core.signals import Power, Signal
from bywire.core.units import shown

Angle = Annotated[float, Unit("rad", 1.0), Field(ge=0, le=math.pi, allow_inf_nan=False)]
LiningFriction = Annotated[float, Unit("1", 0.3), Field(gt=0, lt=1, allow_inf_nan=False)]
LOCKING = 0.9
"""maximum friction coefficient, relative to the coefficient at which a shoe locks"""

Coefficient = Annotated[float, Signal("1", "coefficient of the shoe factors", 0.5)]
ShoeFactor = Annotated[float, Signal("1", "shoe factor", 1.0)]


class Parameters(ParameterSet):
    """Two rigid shoes, each on a pivot, with a cosine pressure along the lining.

    ``law``: with ``"simplex"``, one shoe is leading and the other is trailing in either direction
    of rotation. With ``"duplex"``, both are leading forward and trailing in reverse. With
    ``"servo"``, the first shoe pushes the second one at its free end, in either direction.
    """

    law: Literal["simplex", "duplex", "servo"]
    """arrangement of the shoes"""
    r: Length
    """drum radius"""
    b: Length
    """lining width"""
    a: Length
    """distance of the pivots from the center"""
    c: Length
    """distance of the actuating force from the pivots"""
    theta_1: Angle
    """angle from the pivot to the start of the lining"""
    theta_2: Angle
    """angle from the pivot to the end of the lining"""
    mu: LiningFriction
    """lining friction coefficient"""

    @model_validator(mode="after")
    def _shoes_release(self) -> Parameters:
        if not self.theta_2 > self.theta_1:
            low = math.degrees(self.theta_1)
            raise RuleError(
                "theta_2", f"{math.degrees(self.theta_2):.4g} deg", f"> theta_1 = {low:.4g} deg"
            )
        if not self.c > self.a:
            raise RuleError(
                "c", shown(self.c, "m"), f"> the pivot distance a = {shown(self.a, 'm')}"
            )
        k_0, k_1 = coefficients(self)
        if not (k_1 <= 0.0 or self.mu <= LOCKING * k_0 / k_1):
            limit = LOCKING * k_0 / k_1
            reason = f"because the leading shoe locks at mu = {k_0 / k_1:.3g}"
            raise RuleError("mu", f"{self.mu:g}", f"<= {limit:.3g}", reason)
        return self


FAULTS = (
    ParameterFault("wet", "wet linings", ("mu",), 0.5),
    ParameterFault("glazed", "glazed linings", ("mu",), 0.7),
)


class Input(NamedTuple):
    """Actuating force on each shoe, >= 0, and drum speed."""

    force: Annotated[float, Signal("N", "actuating force on a shoe", 2e3, low=0.0)]
    omega: Annotated[float, Signal("rad/s", "speed of the drum", 50.0)]


class Output(NamedTuple):
    """Bounds of the brake torque. At standstill the torque can have any value between them."""

    T_p: Annotated[float, Signal("N*m", "brake torque, forward", 500.0)]
    T_n: Annotated[float, Signal("N*m", "brake torque, in reverse", 500.0)]


class Moments(NamedTuple):
    """Moments about the pivot, per maximum pressure."""

    normal: Annotated[float, Signal("m**3", "moment of the normal force per pressure", 1e-3)]
    friction: Annotated[float, Signal("m**3", "friction moment per pressure and mu", 1e-3)]
    torque: Annotated[float, Signal("m**3", "brake torque per pressure and mu", 1e-3)]


def moments(par: Parameters) -> Moments:
    r"""Return the integrals of a cosine pressure over the lining, for a pressure of 1.

    .. math::
        \frac{M_N}{p_a} = \frac{a b r}{\sin\theta_a} \int \sin^2\theta\, d\theta, \quad
        \frac{M_F}{\mu p_a} = \frac{b r}{\sin\theta_a} \int \sin\theta (r - a \cos\theta)\,
        d\theta, \quad
        \frac{T}{\mu p_a} = \frac{b r^2}{\sin\theta_a} \int \sin\theta\, d\theta

    The maximum pressure is at :math:`\theta_a`, which is 90 degrees or the end of a shorter lining.

    References
    ----------
    Budynas and Nisbett, Shigley's Mechanical Engineering Design, "Internal Expanding Rim Clutches
    and Brakes".
    """
    s_1, s_2 = ops.sin(par.theta_1), ops.sin(par.theta_2)
    c_1, c_2 = ops.cos(par.theta_1), ops.cos(par.theta_2)
    is_short = par.theta_2 < 0.5 * math.pi
    scale = par.b * par.r / ops.where(is_short, s_2, 1.0)
    squares = 0.5 * (par.theta_2 - par.theta_1) - 0.5 * (s_2 * c_2 - s_1 * c_1)
    products = 0.5 * (s_2 * s_2 - s_1 * s_1)
    return Moments(
        normal=scale * par.a * squares,
        friction=scale * (par.r * (c_1 - c_2) - par.a * products),
        torque=scale * par.r * (c_1 - c_2),
    )


def coefficients(par: Parameters) -> tuple[Coefficient, Coefficient]:
    r"""Return the coefficients of the shoe factors.

    .. math:: k_0 = \frac{r}{c} \frac{M_N}{T/\mu}, \quad k_1 = \frac{r}{c} \frac{M_F/\mu}{T/\mu}

    A shoe's factor is the ratio of its circumferential force T/r to the actuating force,
    :math:`C^* = \mu / (k_0 \mp \mu k_1)`, with the upper sign for a leading shoe. The leading shoe
    locks at :math:`\mu = k_0 / k_1`.
    """
    M, ratio = moments(par), par.r / par.c
    return ratio * M.normal / M.torque, ratio * M.friction / M.torque


def shoe_factors(par: Parameters) -> tuple[ShoeFactor, ShoeFactor]:
    """Return the factors of a leading and of a trailing shoe (see `coefficients`)."""
    k_0, k_1 = coefficients(par)
    return par.mu / (k_0 - par.mu * k_1), par.mu / (k_0 + par.mu * k_1)


def brake_factors(par: Parameters) -> tuple[ShoeFactor, ShoeFactor]:
    r"""Return the ratio of circumferential to actuating force, forward and in reverse.

    Notes
    -----
    With law ``"servo"``, the first shoe floats. It is a leading shoe, and pushes the second shoe
    with the force :math:`F (c - a + C^*_1 r)/a` at the distance ``2 a`` from the second shoe's
    pivot. The second shoe is also a leading shoe.
    """
    leading, trailing = shoe_factors(par)
    if par.law == "duplex":
        return 2.0 * leading, 2.0 * trailing
    if par.law == "simplex":
        return leading + trailing, leading + trailing
    pushed = (par.c - par.a + leading * par.r) / par.a
    # A shoe's factor is proportional to the lever arm of its actuating force.
    total = leading + pushed * leading * 2.0 * par.a / par.c
    return total, total


def output(u: Input, par: Parameters) -> Output:
    r"""Return the bounds of the brake torque, :math:`T = C^* r F`."""
    forward, reverse = brake_factors(par)
    return Output(T_p=forward * par.r * u.force, T_n=reverse * par.r * u.force)


def power_loss(u: Input, par: Parameters) -> Power:
    """Return the lining heat, >= 0."""
    T = output(u, par)
    return ops.where(u.omega > 0, T.T_p, T.T_n) * ops.fabs(u.omega)
