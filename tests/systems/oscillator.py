"""A harmonic oscillator without friction or contact: the smallest model, with a closed form."""

from __future__ import annotations

import math
from typing import Annotated, ClassVar, NamedTuple

from bywire.core.model import Bounds, Matrix, Task
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Duration, Mass, Stiffness
from bywire.core.signals import Signal


class Parameters(ParameterSet):
    """Mass and spring; the one task does nothing every T_s."""

    m: Mass
    k: Stiffness
    T_s: Duration


class State(NamedTuple):
    """Position and velocity."""

    x: Annotated[float, Signal("m", "position")]
    v: Annotated[float, Signal("m/s", "velocity")]


class Memory(NamedTuple):
    """Number of ticks so far."""

    ticks: Annotated[float, Signal("1", "ticks")]


class Stimulus(NamedTuple):
    """Nothing acts from outside; the engine samples it all the same."""

    none: Annotated[float, Signal("1", "unused")]


class Flow(NamedTuple):
    """Integral of the kinetic energy."""

    action: Annotated[float, Signal("J*s", "integral of the kinetic energy")]


class Output(NamedTuple):
    """Recorded signals."""

    x: Annotated[float, Signal("m", "position")]
    v: Annotated[float, Signal("m/s", "velocity")]
    action: Annotated[float, Signal("J*s", "integral of the kinetic energy")]
    ticks: Annotated[float, Signal("1", "ticks")]


PARAMETERS = Parameters(m=0.5, k=2e4, T_s=1e-3)
START = State(0.1, 3.0)


class Oscillator:
    """The model."""

    name: ClassVar[str] = "oscillator"
    State: ClassVar = State
    Memory: ClassVar = Memory
    Stimulus: ClassVar = Stimulus
    Flow: ClassVar = Flow
    Output: ClassVar = Output
    frictions: ClassVar[tuple[str, ...]] = ()
    limits: ClassVar[tuple[str, ...]] = ()
    usually_open: ClassVar[tuple[bool, ...]] = ()

    def tasks(self, par: Parameters) -> tuple[Task, ...]:
        """Return the counter."""
        return (Task("counter", lambda p: float(p.T_s), lambda x, m, u, p: Memory(m.ticks + 1.0)),)

    def mass(self, xe: State, par: Parameters) -> State:
        """Return the mass."""
        return State(1.0, par.m)

    def balance(
        self, x: State, xe: State, m: Memory, par: Parameters, contact: tuple[float, ...]
    ) -> State:
        """Return velocity and spring force."""
        return State(x.v, -par.k * x.x)

    def bounds(
        self, x: State, xe: State, m: Memory, par: Parameters, contact: tuple[float, ...]
    ) -> tuple[Bounds, ...]:
        """Return none."""
        return ()

    def compliance(self, par: Parameters) -> tuple[Matrix, ...]:
        """Return none."""
        return ()

    def gap(self, x: State, xe: State, par: Parameters) -> tuple[tuple[float, ...], ...]:
        """Return none."""
        return ()

    def powers(
        self,
        x: State,
        rate: State,
        m: Memory,
        par: Parameters,
        contact: tuple[float, ...],
        reaction: tuple[float, ...],
    ) -> Flow:
        """Return the kinetic energy."""
        return Flow(0.5 * par.m * x.v * x.v)

    def output(
        self,
        x: State,
        m: Memory,
        par: Parameters,
        contact: tuple[float, ...],
        reaction: tuple[float, ...],
        flow: Flow,
    ) -> Output:
        """Return what is recorded."""
        return Output(x.x, x.v, flow.action, m.ticks)


def closed_form(t: float, par: Parameters = PARAMETERS) -> tuple[float, float, float]:
    """Return position, velocity and the integral of the kinetic energy at a time [s]."""
    rate = math.sqrt(par.k / par.m)
    a, b = START.x, START.v / rate
    x = a * math.cos(rate * t) + b * math.sin(rate * t)
    v = rate * (b * math.cos(rate * t) - a * math.sin(rate * t))
    total = 0.5 * par.m * START.v**2 + 0.5 * par.k * START.x**2
    # Kinetic energy is half the total less half of m d(x v)/dt: the integral is closed.
    action = 0.5 * total * t + 0.25 * par.m * (x * v - START.x * START.v)
    return x, v, action
