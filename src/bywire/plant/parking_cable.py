"""Parking by a drum brake: a cable with friction pulls a lever, which spreads both shoes."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from pydantic import Field

from bywire.core import ops
from bywire.core.faults import ParameterFault
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Unit
from bywire.core.signals import Power, Signal
from bywire.plant import drum

SheathFriction = Annotated[float, Unit("1", 0.1), Field(ge=0, lt=1, allow_inf_nan=False)]
Wrap = Annotated[float, Unit("rad", 3.0), Field(ge=0, le=20, allow_inf_nan=False)]
LeverRatio = Annotated[float, Unit("1", 5.0), Field(gt=1, allow_inf_nan=False)]


class Parameters(ParameterSet):
    """Cable without mass in a curved sheath, and a lever on the secondary shoe."""

    mu: SheathFriction
    """friction coefficient between cable and sheath"""
    phi: Wrap
    """sum of the angles through which the sheath bends"""
    i: LeverRatio
    """ratio of strut force to cable force"""


FAULTS = (ParameterFault("corroded", "corroded cable (value: factor)", ("mu",), 3.0),)


class Input(NamedTuple):
    """Tension at the lever, >= 0, and speed of the cable, positive toward clamping."""

    tension: Annotated[float, Signal("N", "tension at the lever", 500.0, low=0.0)]
    v: Annotated[float, Signal("m/s", "speed of the cable", 0.01)]


class Output(NamedTuple):
    """Magnitudes of the friction on the pulled end of the cable."""

    F_p: Annotated[float, Signal("N", "cable friction, toward clamping", 100.0)]
    F_n: Annotated[float, Signal("N", "cable friction, releasing", 100.0)]


class Shoes(NamedTuple):
    """Forces on the shoes."""

    primary: Annotated[float, Signal("N", "force on the primary shoe", 2e3, low=0.0)]
    secondary: Annotated[float, Signal("N", "force on the secondary shoe", 2e3, low=0.0)]


def output(u: Input, par: Parameters) -> Output:
    r"""Return the friction for motion in either direction.

    .. math:: F_{in} = F e^{\mu \varphi} \text{ (pulling)}, \quad F_{in} = F e^{-\mu \varphi}
        \text{ (releasing)}

    At rest, the friction can have any value between. A released pull therefore leaves a part of the
    tension in the cable.

    References
    ----------
    Budynas and Nisbett, Shigley's Mechanical Engineering Design, "Band-Type Clutches and Brakes"
    (the belt equation).
    """
    wrap = par.mu * par.phi
    return Output(F_p=(ops.exp(wrap) - 1.0) * u.tension, F_n=(1.0 - ops.exp(-wrap)) * u.tension)


def power_loss(u: Input, par: Parameters) -> Power:
    """Return the heat in the sheath, >= 0."""
    F = output(u, par)
    return ops.where(u.v > 0, F.F_p, F.F_n) * ops.fabs(u.v)


def shoes(u: Input, par: Parameters) -> Shoes:
    r"""Return the forces on both shoes.

    The strut pushes the primary shoe with :math:`i F`. The lever turns about its pivot on the
    secondary shoe, which it pushes with :math:`(i - 1) F`.
    """
    return Shoes(primary=par.i * u.tension, secondary=(par.i - 1.0) * u.tension)


def holding_torque(f: Shoes, par: drum.Parameters) -> drum.Output:
    r"""Return the torque at which the drum begins to turn, forward and in reverse.

    .. math:: T = r (C^*_{lead} F_{lead} + C^*_{trail} F_{trail})

    The primary shoe is the leading shoe forward, and the trailing shoe in reverse. The drum has
    the law "simplex".
    """
    leading, trailing = drum.shoe_factors(par)
    return drum.Output(
        T_p=par.r * (leading * f.primary + trailing * f.secondary),
        T_n=par.r * (trailing * f.primary + leading * f.secondary),
    )
