"""Dry friction on the wedge: bearing surfaces, rollers, and a pad on a stopped disc."""

from __future__ import annotations

from typing import Annotated, Literal, NamedTuple

from bywire.core import ops
from bywire.core.faults import ParameterFault
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Gain
from bywire.core.signals import Power, Signal


class Parameters(ParameterSet):
    """Coulomb friction, set-valued at rest.

    ``stopped_disc``: with ``"drop"``, the pad friction vanishes once the disc is at rest, as in
    the paper (worst case for the actuator). With ``"stick"``, the stopped disc holds the wedge.
    """

    mu_int: Gain
    """coefficient of friction at the interfaces between screws and wedge"""
    mu_R: Gain
    """coefficient of friction of the rollers"""
    stopped_disc: Literal["drop", "stick"]
    """pad friction on the wedge while the disc is at rest"""


FAULTS = (
    ParameterFault("worn", "higher friction of rollers and interfaces", ("mu_R", "mu_int"), 5.0),
)


class Input(NamedTuple):
    """Pressing forces, wedge slope and pad friction."""

    squeeze: Annotated[float, Signal("N", "sum of the screws' forces on the wedge", 800.0)]
    F_N: Annotated[float, Signal("N", "normal force", 3e3)]
    tan_alpha: Annotated[float, Signal("1", "slope of the wedge", 0.4)]
    mu_B: Annotated[float, Signal("1", "friction of the pads", 0.35)]
    turning: Annotated[float, Signal("1", "disc direction, 0 when stopped")]


def friction(u: Input, par: Parameters) -> Annotated[float, Signal("N", "wedge friction", 50.0)]:
    r"""Return the magnitude of the friction force on the wedge, along its travel.

    .. math:: F = \mu_{INT} (f_1 + f_2) \tan\alpha + \mu_R F_N

    Notes
    -----
    The wedge slides across the interfaces by tan(alpha) times its travel. The factor tan(alpha)
    then follows from virtual work.

    References
    ----------
    Roberts et al. (2003), sections "Brake heart" and "Wedge and calliper".
    """
    pressed = ops.fmax(u.F_N, 0.0)
    sliding = par.mu_int * u.squeeze * u.tan_alpha + par.mu_R * pressed
    if par.stopped_disc == "drop":
        return sliding
    return sliding + ops.where(u.turning * u.turning > 0.5, 0.0, u.mu_B * pressed)


def power_loss(
    force: Annotated[float, Signal("N", "friction force on the wedge", 50.0)],
    v: Annotated[float, Signal("m/s", "velocity of the wedge", 0.02)],
) -> Power:
    """Return the friction heat (signed: minus force times velocity)."""
    return -force * v
