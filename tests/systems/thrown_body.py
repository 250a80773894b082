"""A body thrown against a constant force and dry friction: it turns round and comes back."""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

import numpy as np

from bywire.core.model import Model, Task
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Unit
from bywire.core.signals import Signal
from bywire.simulation.run import Run

FORCE, THROWN_AT = -2.0, 0.1037


class Parameters(ParameterSet):
    """Mass, dry friction, gain of a sampled brake."""

    m: Annotated[float, Unit("kg")]
    T: Annotated[float, Unit("N")]
    g: Annotated[float, Unit("N*s/m")] = 0.0


class State(NamedTuple):
    """Motion."""

    x: Annotated[float, Signal("m", "travel")]
    v: Annotated[float, Signal("m/s", "speed")]


class Force(NamedTuple):
    """What acts."""

    F: Annotated[float, Signal("N", "force")]


class Work(NamedTuple):
    """Work of the force."""

    W: Annotated[float, Signal("J", "work")]


class ThrownBody(Model):
    """m dv/dt = F - g v_k - T sign(v), with the speed v_k at the last tick."""

    name = "thrown-body"
    State, Memory, Stimulus, Flow, Output = State, Force, Force, Work, State
    frictions = ("v",)

    def tasks(self, par: Parameters) -> tuple[Task, ...]:
        return (Task("force", 1e-2, lambda x, m, u, par: Force(u.F - par.g * x.v)),)

    def mass(self, xe: State, par: Parameters) -> State:
        return State(1.0, par.m)

    def balance(self, x: State, xe: State, m: Force, par: Parameters, contact: Any) -> State:
        return State(x.v, m.F)

    def bounds(self, x: State, xe: State, m: Force, par: Parameters, contact: Any) -> Any:
        return ((-par.T, par.T),)

    def powers(self, x: State, xe: Any, rate: Any, m: Force, *_: Any) -> Work:
        return Work(m.F * x.v)

    def output(self, x: State, *_: Any) -> State:
        return x


def thrown(step: float) -> Run:
    """Return 0.1 s from the throw."""
    par = Parameters(m=0.5, T=0.5)
    return Run(
        ThrownBody(),
        par,
        State(0.0, THROWN_AT),
        Force(FORCE),
        lambda t: np.full((t.size, 1), FORCE),
        0.1,
        step,
        1e-2,
    )
