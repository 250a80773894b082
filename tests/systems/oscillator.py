"""An oscillator, harmonic or with Coulomb friction: the smallest models, with closed forms."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, ClassVar, NamedTuple

from bywire.core.model import Bounds, Matrix, Model, Task
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Duration, Force, Mass, Stiffness
from bywire.core.signals import Signal


class Parameters(ParameterSet):
    """Mass, spring, friction; the one task counts every T_s."""

    m: Mass
    k: Stiffness
    F_c: Force
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


PARAMETERS = Parameters(m=0.5, k=2e4, F_c=120.0, T_s=1e-3)
START = State(0.1, 3.0)


@dataclass(frozen=True)
class Oscillator(Model):
    """The model, with or without friction."""

    rubs: bool = False

    name: ClassVar[str] = "oscillator"
    State: ClassVar = State
    Memory: ClassVar = Memory
    Stimulus: ClassVar = Stimulus
    Flow: ClassVar = Flow
    Output: ClassVar = Output
    limits: ClassVar[tuple[str, ...]] = ()
    usually_open: ClassVar[tuple[bool, ...]] = ()

    @property
    def frictions(self) -> tuple[str, ...]:
        """Return the velocity if it rubs."""
        return ("v",) if self.rubs else ()

    def tasks(self, par: Parameters) -> tuple[Task, ...]:
        """Return the counter."""
        return (Task("counter", par.T_s, lambda x, m, u, p: Memory(m.ticks + 1.0)),)

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
        """Return those of Coulomb friction."""
        return ((-par.F_c, par.F_c),) if self.rubs else ()

    def compliance(self, par: Parameters) -> tuple[Matrix, ...]:
        """Return none."""
        return ()

    def gap(self, x: State, xe: State, par: Parameters) -> tuple[tuple[float, ...], ...]:
        """Return none."""
        return ()

    def powers(
        self,
        x: State,
        xe: State,
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


def rubbing(t: float, x_0: float, par: Parameters = PARAMETERS) -> tuple[float, float]:
    """Return position and velocity at a time [s] after a release at rest from x_0 > 0, rubbing.

    Each half cycle is harmonic about a center off by F_c / k; the swing loses twice that, and ends
    where the spring cannot overcome the friction.
    """
    rate, off = math.sqrt(par.k / par.m), par.F_c / par.k
    phase, swing, side = rate * t, x_0, 1.0
    while swing > off:
        if phase < math.pi:
            x = off + (swing - off) * math.cos(phase)
            return side * x, -side * rate * (swing - off) * math.sin(phase)
        phase, swing, side = phase - math.pi, swing - 2.0 * off, -side
        if swing < 0.0:
            swing, side = -swing, -side
    return side * swing, 0.0
