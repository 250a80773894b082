"""Screw of a clearance adjuster, which reduces the clearance by turning, and otherwise holds it.

A controller sets its speed. The screw is self-locking, so no load drives it.
"""

from __future__ import annotations

from typing import Annotated, Literal, NamedTuple

from pydantic import Field

from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Length, Unit
from bywire.core.signals import Signal

Lag = Annotated[float, Unit("s", 5e-3), Field(gt=0, allow_inf_nan=False)]


class Parameters(ParameterSet):
    """Screw that follows its drive with a first-order lag.

    ``law``: with ``"screw"``, the brake has an adjuster; with ``"none"``, it has none.
    """

    law: Literal["none", "screw"]
    """whether the brake has an adjuster"""
    tooth: Length
    """clearance removed by one tooth"""
    tau_turn: Lag
    """time constant with which the screw speed follows the drive speed"""


class State(NamedTuple):
    """Removed clearance, and its rate."""

    taken: Annotated[float, Signal("m", "clearance removed by the adjuster", 1e-4)]
    taking: Annotated[float, Signal("m/s", "speed of the adjuster", 0.01)]


class Rate(NamedTuple):
    """Derivatives of the state."""

    taken: Annotated[float, Signal("m/s", "speed of the adjuster", 0.01)]
    taking: Annotated[float, Signal("m/s**2", "acceleration of the adjuster", 2.0)]


class Input(NamedTuple):
    """Drive speed."""

    turning: Annotated[float, Signal("1/s", "teeth turned per second", 50.0)]


def rate(x: State, u: Input, par: Parameters) -> Rate:
    r"""Return the derivatives of the screw's motion.

    .. math:: \tau \ddot c + \dot c = s \dot n

    with a travel s per tooth. Whole teeth of the drive change the clearance by whole teeth.
    """
    if par.law == "none":
        return Rate(0.0, 0.0)
    return Rate(x.taking, (par.tooth * u.turning - x.taking) / par.tau_turn)


def moved(x: State, par: Parameters) -> State:
    """Return removed clearance and speed, zero without an adjuster."""
    return State(0.0, 0.0) if par.law == "none" else x
