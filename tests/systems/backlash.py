"""Free play between a driver and a follower that friction holds, with its describing function."""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

import numpy as np

from bywire.core import ops
from bywire.core.model import Task
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Duration, Force, Length, Mass, Stiffness, TimeConstant
from bywire.core.signals import Signal
from systems.describing import T_S, Held, Recorded, System


class Pair(NamedTuple):
    """Driver and follower."""

    x_d: Annotated[float, Signal("m", "driver")]
    x: Annotated[float, Signal("m", "follower")]
    v: Annotated[float, Signal("m/s", "follower's velocity")]


class BacklashParameters(ParameterSet):
    """A follower between two stops of the driver, on a rough floor."""

    m: Mass
    F_c: Force
    k: Stiffness
    play: Length
    """from the middle to either stop"""
    tau: TimeConstant
    T_s: Duration


class Backlash(System):
    """Contacts with free play; friction holds the follower while neither touches."""

    name = "backlash"
    State = Pair
    frictions = ("v",)
    usually_open = (False,)

    def tasks(self, par):
        """Return the driver: within a sample it goes where it was told."""
        return (Task("source", par.T_s, lambda x, m, u, p: Held((u.u - x.x_d) / p.T_s)),)

    def mass(self, xe, par):
        """Return the follower's mass."""
        return Pair(1.0, 1.0, par.m)

    def balance(self, x, xe, m, par, contact):
        """Return velocities and the forces of the stops."""
        return Pair(m.u, x.v, contact[0] - contact[1])

    def bounds(self, x, xe, m, par, contact):
        """Return those of Coulomb friction."""
        return ((-par.F_c, par.F_c),)

    def compliance(self, par):
        """Return that of the two stops."""
        return (((1.0 / par.k, 0.0), (0.0, 1.0 / par.k)),)

    def gap(self, x, xe, par):
        """Return the overlaps with both stops, lightly damped."""
        apart = x.x_d - x.x
        return ((apart - par.play - par.tau * x.v, -apart - par.play + par.tau * x.v),)

    def output(self, x, m, par, contact, reaction, flow):
        """Return the follower, and whether it rests."""
        return Recorded(x.x, ops.where(x.v == 0, 1.0, 0.0))


def backlash(size: float, par: BacklashParameters, f: float) -> complex:
    """Return the describing function of the play, widened by what friction presses the stops in.

    The follower waits from the driver's turning point until the play is crossed; the driver is a
    sample late.
    """
    b = (par.play + par.F_c / par.k) / size
    if b >= 1.0:
        return 0.0
    c = 1.0 - 2.0 * b
    real = (0.5 * math.pi + math.asin(c) + c * math.sqrt(1.0 - c * c)) / math.pi
    imaginary = -4.0 * b * (1.0 - b) / math.pi
    return (real + 1j * imaginary) * np.exp(-2j * math.pi * f * par.T_s)


BACKLASH = BacklashParameters(m=0.05, F_c=2.0, k=1e7, play=2e-4, tau=1e-5, T_s=T_S)
