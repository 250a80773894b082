"""Roller screw, which converts rotation to travel, with different losses when back-driven."""

from __future__ import annotations

import math
from typing import Annotated, Literal, NamedTuple

from pydantic import Field

from bywire.core import ops
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Fraction, Length, Unit
from bywire.core.signals import Power, Signal, Torque

BackEfficiency = Annotated[float, Unit("1", 0.5), Field(ge=-10, le=1, allow_inf_nan=False)]


class Parameters(ParameterSet):
    """Massless screw with friction proportional to its load.

    ``law``: with ``"load"`` (interpretation A), the loss is friction proportional to the axial
    force and set-valued at rest. With ``"drive"`` (interpretation B), the screw loses (1 - eta_f)
    of the motor torque in either direction.
    """

    lead: Length
    """travel per revolution"""
    eta_f: Fraction
    """efficiency when the screw drives the load"""
    eta_b: BackEfficiency
    """efficiency when the load drives the screw: 2 - 1/eta_f for equal losses, <= 0 if it locks"""
    law: Literal["load", "drive"]
    """quantity to which the loss is proportional: axial force or motor torque"""


class Input(NamedTuple):
    """Axial force on the screw, positive toward clamping, and motor torque."""

    force: Annotated[float, Signal("N", "axial force on the screw", 500.0)]
    torque: Annotated[float, Signal("N*m", "motor torque", 0.3)]


class Output(NamedTuple):
    """Magnitudes of the friction torque in both directions."""

    T_p: Annotated[float, Signal("N*m", "screw friction, toward clamping", 0.05)]
    T_n: Annotated[float, Signal("N*m", "screw friction, releasing", 0.05)]


def slope(par: Parameters) -> Annotated[float, Signal("m/rad", "travel per angle", 3e-4)]:
    r"""Return the travel per shaft angle, :math:`L / 2\pi`."""
    return par.lead / (2.0 * math.pi)


def load_torque(u: Input, par: Parameters) -> Torque:
    r"""Return the shaft torque from the axial force, :math:`T = F L / 2\pi`.

    References
    ----------
    Roberts et al. (2003), section "Rollerscrew and bearings", without losses.
    """
    return slope(par) * u.force


def friction(u: Input, par: Parameters) -> Output:
    r"""Return the friction torque of the screw for motion in either direction.

    .. math::
        T = (1/\eta_f - 1) |F| L/2\pi \text{ (load opposes)}, \quad
        T = (1 - \eta_b) |F| L/2\pi \text{ (load aids)}

    for law "load", and :math:`(1 - \eta_f) |T_M|` for law "drive".

    Notes
    -----
    The paper states a loss (1 - eta) T_DRIVE that acts as friction. Law "load" is equivalent at
    constant speed, needs no algebraic loop, and holds the load at rest.

    References
    ----------
    Roberts et al. (2003), section "Rollerscrew and bearings".
    """
    if par.law == "drive":
        loss = (1.0 - par.eta_f) * ops.fabs(u.torque)
        return Output(T_p=loss, T_n=loss)
    load = load_torque(u, par)
    opposing = (1.0 / par.eta_f - 1.0) * ops.fabs(load)
    aiding = (1.0 - par.eta_b) * ops.fabs(load)
    return Output(
        T_p=ops.where(load < 0, opposing, aiding),
        T_n=ops.where(load > 0, opposing, aiding),
    )


def power_loss(
    u: Input, omega: Annotated[float, Signal("rad/s", "motor speed", 50.0)], par: Parameters
) -> Power:
    """Return the heat from the sliding screw, >= 0."""
    T = friction(u, par)
    return ops.where(omega > 0, T.T_p, T.T_n) * ops.fabs(omega)
