"""A lag that a sampled controller drives, and a spring that stores what it holds: closed forms."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from bywire.core.model import Model, Task
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Duration, Factor
from bywire.core.signals import Signal

Value = Annotated[float, Signal("N", "value", 1.0)]


class State(NamedTuple):
    """What lags."""

    y: Value


class Memory(NamedTuple):
    """What the controller read, and gives out."""

    seen: Value
    drive: Value


class Stimulus(NamedTuple):
    """What is wanted."""

    wanted: Value


class Flow(NamedTuple):
    """Nothing."""


class Output(NamedTuple):
    """All of it, and a stored energy that the stiffness decides."""

    y: Value
    seen: Value
    drive: Value
    E_stored: Annotated[float, Signal("J", "stored")]


class LagParameters(ParameterSet):
    """Time constant, gain, stiffness, sample time."""

    tau: Duration
    k: Factor
    c: Factor
    T_s: Duration


class SampledLag(Model):
    """``tau y' = drive - y`` with ``drive = k (wanted - seen) + wanted`` at each tick."""

    name = "sampled-lag"
    State, Memory, Stimulus, Flow, Output = State, Memory, Stimulus, Flow, Output

    def tasks(self, par):
        """Return the controller."""

        def tick(x, m, u, p):
            return Memory(x.y, p.k * (u.wanted - x.y) + u.wanted)

        return (Task("law", par.T_s, tick),)

    def mass(self, xe, par):
        """Return the time constant."""
        return State(par.tau)

    def balance(self, x, xe, m, par, contact):
        """Return what drives the lag."""
        return State(m.drive - x.y)

    def powers(self, x, xe, rate, m, par, contact, reaction):
        """Return nothing."""
        return Flow()

    def output(self, x, m, par, contact, reaction, flow):
        """Return what is recorded."""
        return Output(x.y, m.seen, m.drive, 0.5 * par.c * x.y * x.y)


LAG = LagParameters(tau=0.05, k=2.0, c=3.0, T_s=0.01)
