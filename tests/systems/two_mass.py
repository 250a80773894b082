"""Two masses with dry friction, a stiff spring between them, and a wall: a rig for the engine.

The drive pushes mass 1 over a cogged rail. The spring hardens, the friction of mass 2 grows with
its force on the wall, so that the rig has everything that the engine treats apart: nonlinear
terms, value-only terms, two coupled frictions, a contact.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bywire.core import ops
from bywire.core.model import Bounds, Matrix, Model, Task
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import (
    Damping,
    Duration,
    Force,
    Gain,
    Length,
    Mass,
    Position,
    Stiffness,
    TimeConstant,
)
from bywire.core.signals import Signal
from bywire.simulation.run import Run


class Parameters(ParameterSet):
    """Masses, spring, rail, frictions, wall."""

    m_1: Mass
    m_2: Mass
    k: Stiffness
    s_hard: Length
    """elongation at which the spring's cubic part reaches the linear one"""
    damping: Damping
    cogging: Force
    pitch: Length
    F_c1: Force
    """friction of mass 1 toward the wall; F_r1 away from it"""
    F_r1: Force
    F_c2: Force
    mu: Gain
    """growth of the friction of mass 2 with its force on the wall"""
    k_wall: Stiffness
    tau_wall: TimeConstant
    x_wall: Position
    T_s: Duration


class State(NamedTuple):
    """Positions and velocities, positive toward the wall."""

    x_1: Annotated[float, Signal("m", "position 1", 1e-4)]
    v_1: Annotated[float, Signal("m/s", "velocity 1", 0.05)]
    x_2: Annotated[float, Signal("m", "position 2", 1e-4)]
    v_2: Annotated[float, Signal("m/s", "velocity 2", 0.05)]


class Memory(NamedTuple):
    """Held drive force."""

    force: Annotated[float, Signal("N", "drive force", 100.0)]


class Stimulus(NamedTuple):
    """Demanded drive force."""

    force: Annotated[float, Signal("N", "demanded force", 100.0)]


class Flow(NamedTuple):
    """Energies."""

    E_source: Annotated[float, Signal("J", "work of the drive")]
    E_friction: Annotated[float, Signal("J", "friction loss")]
    E_damping: Annotated[float, Signal("J", "loss in spring and wall")]


class Output(NamedTuple):
    """Recorded signals."""

    x_1: Annotated[float, Signal("m", "position 1", 1e-4)]
    v_1: Annotated[float, Signal("m/s", "velocity 1", 0.05)]
    x_2: Annotated[float, Signal("m", "position 2", 1e-4)]
    v_2: Annotated[float, Signal("m/s", "velocity 2", 0.05)]
    friction_1: Annotated[float, Signal("N", "friction force 1", 50.0)]
    friction_2: Annotated[float, Signal("N", "friction force 2", 50.0)]
    F_wall: Annotated[float, Signal("N", "force of the wall", 100.0)]
    E_source: Annotated[float, Signal("J", "work of the drive")]
    E_friction: Annotated[float, Signal("J", "friction loss")]
    E_damping: Annotated[float, Signal("J", "loss in spring and wall")]
    E_stored: Annotated[float, Signal("J", "stored energy")]


PARAMETERS = Parameters(
    m_1=0.8,
    m_2=0.5,
    k=2e7,
    s_hard=2e-5,
    damping=300.0,
    cogging=5.0,
    pitch=1e-4,
    F_c1=30.0,
    F_r1=20.0,
    F_c2=10.0,
    mu=0.3,
    k_wall=5e7,
    tau_wall=2e-5,
    x_wall=2e-4,
    T_s=1e-3,
)
AT_REST = State(0.0, 0.0, 0.0, 0.0)
IDLE = Memory(0.0)


@dataclass(frozen=True)
class TwoMass(Model):
    """The model; ``rare`` declares the wall as rarely touched, which must not change results."""

    rare: bool = False

    name: ClassVar[str] = "two-mass"
    State: ClassVar = State
    Memory: ClassVar = Memory
    Stimulus: ClassVar = Stimulus
    Flow: ClassVar = Flow
    Output: ClassVar = Output
    frictions: ClassVar[tuple[str, ...]] = ("v_1", "v_2")
    limits: ClassVar[tuple[str, ...]] = ()

    @property
    def usually_open(self) -> tuple[bool, ...]:
        """Return what is declared of the wall."""
        return (self.rare,)

    def tasks(self, par: Parameters) -> tuple[Task, ...]:
        """Return the drive: it holds the demanded force."""
        return (Task("drive", par.T_s, lambda x, m, u, p: Memory(u.force)),)

    def mass(self, xe: State, par: Parameters) -> State:
        """Return the masses."""
        return State(1.0, par.m_1, 1.0, par.m_2)

    def balance(
        self, x: State, xe: State, m: Memory, par: Parameters, contact: tuple[float, ...]
    ) -> State:
        """Return velocities and forces."""
        spring = _spring(x, par) + par.damping * (x.v_1 - x.v_2)
        cogging = par.cogging * ops.sin(2.0 * math.pi * xe.x_1 / par.pitch)
        return State(x.v_1, m.force - spring - cogging, x.v_2, spring - contact[0])

    def bounds(
        self, x: State, xe: State, m: Memory, par: Parameters, contact: tuple[float, ...]
    ) -> tuple[Bounds, ...]:
        """Return the friction bounds."""
        limit = par.F_c2 + par.mu * contact[0]
        return ((-par.F_c1, par.F_r1), (-limit, limit))

    def compliance(self, par: Parameters) -> tuple[Matrix, ...]:
        """Return that of the wall."""
        return (((1.0 / par.k_wall,),),)

    def gap(self, x: State, xe: State, par: Parameters) -> tuple[tuple[float, ...], ...]:
        """Return the damped overlap with the wall."""
        return ((x.x_2 - par.x_wall + par.tau_wall * x.v_2,),)

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
        """Return drive power and losses."""
        sliding = x.v_1 - x.v_2
        depth = ops.fmax(x.x_2 - par.x_wall, 0.0)
        return Flow(
            E_source=m.force * x.v_1,
            E_friction=-reaction[0] * x.v_1 - reaction[1] * x.v_2,
            E_damping=par.damping * sliding * sliding + (contact[0] - par.k_wall * depth) * x.v_2,
        )

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
        return Output(*x, *reaction, contact[0], *flow, _stored(x, par))


def _spring(x: State, par: Parameters) -> float:
    s = x.x_1 - x.x_2
    return par.k * s * (1.0 + s * s / (par.s_hard * par.s_hard))


def _stored(x: State, par: Parameters) -> float:
    s = x.x_1 - x.x_2
    spring = par.k * s * s * (0.5 + 0.25 * s * s / (par.s_hard * par.s_hard))
    wave = 2.0 * math.pi / par.pitch
    rail = -par.cogging / wave * (ops.cos(wave * x.x_1) - 1.0)
    # Not the overlap's sign but the force of a wall that does not pull: it stores what it returns.
    depth = ops.fmax(x.x_2 - par.x_wall, 0.0)
    kinetic = 0.5 * (par.m_1 * x.v_1 * x.v_1 + par.m_2 * x.v_2 * x.v_2)
    return kinetic + spring + rail + 0.5 * par.k_wall * depth * depth


def shaken(t: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a force that drives mass 2 against the wall and off it, with rests in between."""
    return (80.0 * np.sin(2.0 * math.pi * 60.0 * t) + 25.0)[:, None]


def rig(
    duration: float,
    step: float = 20e-6,
    record: float = 1e-4,
    rare: bool = False,
    **changes: float,
) -> Run:
    """Return a run of the shaken rig from rest, with other parameters where they are named."""
    par = PARAMETERS.replace(changes)
    return Run(TwoMass(rare), par, AT_REST, IDLE, shaken, duration, step, record)
