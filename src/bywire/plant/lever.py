"""Lever of an air brake: the arm of a disc brake's eccentric, or the slack adjuster of an S-cam."""

from __future__ import annotations

from typing import Annotated, Literal, NamedTuple

from pydantic import Field

from bywire.core import ops
from bywire.core.faults import ParameterFault
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Force, Length, Unit
from bywire.core.signals import Role, Signal

Ratio = Annotated[float, Unit("1", 15.0), Field(gt=0, le=50, allow_inf_nan=False)]
LeverAngle = Annotated[float, Unit("rad", 0.2), Field(gt=-1.2, lt=1.2, allow_inf_nan=False)]
LoadFriction = Annotated[float, Unit("1", 0.05), Field(ge=0, lt=1, allow_inf_nan=False)]
RodTravel = Annotated[float, Signal("m", "rod travel", 0.02, low=0.0, high=0.04)]
PadTravel = Annotated[float, Signal("m", "travel of the pads", 1e-3)]
PadsPerRod = Annotated[float, Signal("1", "travel of the pads per travel of the rod", 0.07)]
RodForce = Annotated[float, Signal("N", "force at the rod", 5e3)]
Loss = Annotated[float, Signal("W", "friction loss", role=Role("sink", "lever friction"))]
_MOST = 0.95  # sine of the largest lever angle, about 72 degrees


class Parameters(ParameterSet):
    """Massless lever, whose cam or eccentric has a constant effective radius.

    ``law``: with ``"constant"``, the ratio is constant. With ``"turning"``, the rod moves straight
    and the lever turns, so the ratio falls on both sides of the position in which the lever is
    perpendicular to the rod. Friction of 1 or more would never let the brake release.
    """

    law: Literal["constant", "turning"]
    """whether the ratio depends on the travel"""
    i: Ratio
    """travel of the rod per travel of the pads, with the lever perpendicular to the rod"""
    L: Length
    """length of the lever, from its shaft to the rod (law "turning")"""
    phi_0: LeverAngle
    """angle from the released to the perpendicular position (law "turning")"""
    F_fr: Force
    """friction without load, at the rod"""
    mu: LoadFriction
    """friction per load, in bearings and cam, as a fraction of the load at the rod"""


FAULTS = (
    ParameterFault("rusty", "rusty bearings or cam", ("mu", "F_fr"), 4.0),
    ParameterFault(
        "misadjusted",
        "lever far from its perpendicular position (value: angle)",
        replaced="phi_0",
        value=0.9,
        with_it={"law": "turning"},
    ),
)


class Input(NamedTuple):
    """Travel and speed of the rod, and the force of the pads."""

    x: RodTravel
    v: Annotated[float, Signal("m/s", "rod speed", 0.5)]
    force: Annotated[float, Signal("N", "force of the pads", 5e4, low=0.0)]


def travel(x: RodTravel, par: Parameters) -> PadTravel:
    r"""Return the travel of the pads for a travel of the rod.

    .. math:: y = x / i, \quad \text{or} \quad
        y = \frac{L}{i} (\varphi + \varphi_0), \quad x = L (\sin\varphi + \sin\varphi_0)
    """
    if par.law == "constant":
        return x / par.i
    sine = _sine(x, par)
    angle = ops.arctan(sine / ops.sqrt(1.0 - sine * sine))
    return par.L / par.i * (angle + par.phi_0)


def slope(x: RodTravel, par: Parameters) -> PadsPerRod:
    r"""Return the travel of the pads per travel of the rod, :math:`1/(i \cos\varphi)`.

    Notes
    -----
    With law "turning", travel and slope have a kink where the lever is 72 degrees from its
    perpendicular position, and they are not valid farther away.
    """
    if par.law == "constant":
        return 1.0 / par.i
    sine = _sine(x, par)
    return 1.0 / (par.i * ops.sqrt(1.0 - sine * sine))


def _sine(x: RodTravel, par: Parameters) -> float:
    return ops.clip(x / par.L - ops.sin(par.phi_0), -_MOST, _MOST)


def load(u: Input, par: Parameters) -> RodForce:
    r"""Return the force of the pads at the rod without friction, :math:`F/(i \cos\varphi)`."""
    return slope(u.x, par) * u.force


def friction(u: Input, par: Parameters) -> RodForce:
    r"""Return the magnitude of the friction force at the rod, which is set-valued at rest.

    .. math:: F_{fr} = F_{fr,0} + \mu F/(i \cos\varphi)

    A rod force F_r therefore holds every force of the pads between :math:`i (F_r - F_{fr,0})/(1 +
    \mu)` and :math:`i (F_r + F_{fr,0})/(1 - \mu)`.
    """
    return par.F_fr + par.mu * load(u, par)


def power_loss(u: Input, par: Parameters) -> Loss:
    """Return the friction heat, >= 0."""
    return friction(u, par) * ops.fabs(u.v)
