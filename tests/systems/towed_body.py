"""A body that a moving one pulls by a spring until it breaks away: two coupled dry frictions."""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

import numpy as np

from bywire.core.model import Model, Task
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Unit
from bywire.core.signals import Signal
from bywire.simulation.run import Run

PULL = 0.2  # speed of the heavy body [m/s]


class Parameters(ParameterSet):
    """Masses, spring, frictions."""

    M: Annotated[float, Unit("kg")]
    m: Annotated[float, Unit("kg")]
    k: Annotated[float, Unit("N/m")]
    T_M: Annotated[float, Unit("N")]
    T: Annotated[float, Unit("N")]


class State(NamedTuple):
    """Positions and velocities of the heavy body and of the towed one."""

    X: Annotated[float, Signal("m", "travel of the heavy body")]
    V: Annotated[float, Signal("m/s", "speed of the heavy body")]
    x: Annotated[float, Signal("m", "travel")]
    v: Annotated[float, Signal("m/s", "speed")]


class Nothing(NamedTuple):
    """Nothing is commanded."""

    F: Annotated[float, Signal("N", "force")]


class TowedBody(Model):
    """M dV/dt = k (x - X) - T_M sign(V); m dv/dt = k (X - x) - T sign(v)."""

    name = "towed-body"
    State, Memory, Stimulus, Flow, Output = State, Nothing, Nothing, Nothing, State
    frictions = ("V", "v")

    def tasks(self, par: Parameters) -> tuple[Task, ...]:
        return (Task("hold", 1e-2, lambda x, m, u, par: u),)

    def mass(self, xe: State, par: Parameters) -> State:
        return State(1.0, par.M, 1.0, par.m)

    def balance(self, x: State, xe: State, m: Nothing, par: Parameters, contact: Any) -> State:
        pull = par.k * (x.X - x.x)
        return State(x.V, m.F - pull, x.v, pull)

    def bounds(self, x: State, xe: State, m: Nothing, par: Parameters, contact: Any) -> Any:
        return ((-par.T_M, par.T_M), (-par.T, par.T))

    def powers(self, x: State, xe: Any, rate: Any, m: Nothing, *_: Any) -> Nothing:
        return Nothing(m.F * x.V)

    def output(self, x: State, *_: Any) -> State:
        return x


def towed(step: float) -> Run:
    """Return 40 ms from the moment at which the spring begins to pull; it breaks away after 8."""
    par = Parameters(M=1e6, m=0.5, k=2e4, T_M=0.1, T=32.4)
    return Run(
        TowedBody(),
        par,
        State(0.0, PULL, 0.0, 0.0),
        Nothing(0.0),
        lambda t: np.zeros((t.size, 1)),
        0.04,
        step,
        1e-2,
    )
