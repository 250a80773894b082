"""Modulator of a pneumatic anti-lock system, with a hold valve and a vent valve that lag."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from bywire.core.faults import ParameterFault
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Duration
from bywire.core.signals import Signal

Command = Annotated[float, Signal("1", "valve command", 0.5, low=0.0, high=1.0)]


class Parameters(ParameterSet):
    """Diaphragm valves. Without current, the hold valve is open and the vent valve closed."""

    tau_hold: Duration
    """time constant of the hold valve"""
    tau_vent: Duration
    """time constant of the vent valve"""


FAULTS = (ParameterFault("sluggish", "frozen diaphragms", ("tau_hold", "tau_vent"), 4.0),)


class State(NamedTuple):
    """Openings of the valves."""

    hold: Annotated[float, Signal("1", "opening of the hold valve", 0.5, low=0.0, high=1.0)]
    vent: Annotated[float, Signal("1", "opening of the vent valve", 0.5, low=0.0, high=1.0)]


class Factors(NamedTuple):
    """Factors of the derivatives."""

    hold: Annotated[float, Signal("s", "time constant", 1e-2)]
    vent: Annotated[float, Signal("s", "time constant", 1e-2)]


class Balance(NamedTuple):
    """Distances to the new openings."""

    hold: Annotated[float, Signal("1", "distance to the new opening", 0.5)]
    vent: Annotated[float, Signal("1", "distance to the new opening", 0.5)]


class Input(NamedTuple):
    """Currents of the solenoids, 0 or 1."""

    close: Command
    vent: Command


def mass(par: Parameters) -> Factors:
    """Return the time constants."""
    return Factors(hold=par.tau_hold, vent=par.tau_vent)


def balance(x: State, u: Input) -> Balance:
    r"""Return the distances to the new openings, :math:`\tau \dot a = a_{new} - a`."""
    return Balance(hold=1.0 - u.close - x.hold, vent=u.vent - x.vent)
