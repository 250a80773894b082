"""Ball screw, which converts an angle to a travel, and a force to a torque."""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

from bywire.authoring import Length, ParameterSet, Signal


class Parameters(ParameterSet):
    """A rigid, lossless screw. All friction acts on the motor shaft."""

    lead: Length
    """travel per turn"""


class Input(NamedTuple):
    """Screw motion and force on the nut."""

    theta: Annotated[float, Signal("rad", "screw angle", 2.0)]
    omega: Annotated[float, Signal("rad/s", "screw speed", 3.0)]
    force: Annotated[float, Signal("N", "force on the nut, against its travel", 1e4)]


class Output(NamedTuple):
    """Nut motion and load on the screw."""

    x: Annotated[float, Signal("m", "piston travel", 1e-3)]
    v: Annotated[float, Signal("m/s", "piston speed", 3e-3)]
    load: Annotated[float, Signal("N*m", "load on the screw", 10.0)]


def slope(par: Parameters) -> Annotated[float, Signal("m/rad", "travel per angle", 1e-3)]:
    """Return the travel per radian."""
    return par.lead / (2.0 * math.pi)


def output(u: Input, par: Parameters) -> Output:
    """Return nut motion and load on the screw. Input power equals output power."""
    k = slope(par)
    return Output(x=k * u.theta, v=k * u.omega, load=k * u.force)
