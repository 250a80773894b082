"""Adjuster's screw: takes clearance away while it turns, and holds its place otherwise.

A controller holds how fast it turns; it is self-locking, so that no load drives it.
"""

from __future__ import annotations

from typing import Annotated, Literal, NamedTuple

from pydantic import Field

from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Length, Unit
from bywire.core.signals import Signal

Lag = Annotated[float, Unit("s", 5e-3), Field(gt=0, allow_inf_nan=False)]


class Parameters(ParameterSet):
    """A screw that follows its drive with a lag of first order.

    ``law``: ``"screw"``; ``"none"``: the brake has no adjuster.
    """

    law: Literal["none", "screw"]
    """whether the brake has an adjuster"""
    tooth: Length
    """clearance that a tooth takes away"""
    tau_turn: Lag
    """time constant with which its speed follows that of its drive"""


class State(NamedTuple):
    """Clearance taken away, and its rate."""

    taken: Annotated[float, Signal("m", "clearance that the adjuster took away", 1e-4)]
    taking: Annotated[float, Signal("m/s", "speed of the adjuster", 0.01)]


class Rate(NamedTuple):
    """Derivatives of the state."""

    taken: Annotated[float, Signal("m/s", "speed of the adjuster", 0.01)]
    taking: Annotated[float, Signal("m/s**2", "acceleration of the adjuster", 2.0)]


class Input(NamedTuple):
    """How it is turned."""

    turning: Annotated[float, Signal("1/s", "teeth turned in a second", 50.0)]


def rate(x: State, u: Input, par: Parameters) -> Rate:
    r"""Return how the screw moves.

    .. math:: \tau \ddot c + \dot c = s \dot n

    with teeth of s, turned at a speed. In the end the clearance has changed by whole teeth, as
    long as whole teeth were turned.
    """
    if par.law == "none":
        return Rate(0.0, 0.0)
    return Rate(x.taking, (par.tooth * u.turning - x.taking) / par.tau_turn)


def moved(x: State, par: Parameters) -> State:
    """Return clearance taken away and speed; zero without an adjuster."""
    return State(0.0, 0.0) if par.law == "none" else x
