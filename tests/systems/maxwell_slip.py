"""A mass on springs that slip (Maxwell slip), driven by a force or moved at a given speed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, NamedTuple

import numpy as np

from bywire.core import ops
from bywire.core.model import Bounds, Model, Task
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Duration, Force, Mass, Stiffness
from bywire.core.signals import Signal, zeros
from bywire.simulation.run import Run

Travel = Annotated[float, Signal("m", "deflection", 1e-4)]
COUNT = 4


class Parameters(ParameterSet):
    """Mass, elastic spring, springs that slip; the one task holds its inputs for T_s."""

    m: Mass
    k: Stiffness
    F_c: Force
    """dry friction of the mass"""
    F_load: Force
    """elastic force at which the slip forces of a loaded model are twice as large"""
    k_1: Stiffness
    k_2: Stiffness
    k_3: Stiffness
    k_4: Stiffness
    W_1: Force
    W_2: Force
    W_3: Force
    W_4: Force
    T_s: Duration

    @property
    def stiffnesses(self) -> tuple[float, ...]:
        """Stiffnesses of the springs that slip."""
        return self.k_1, self.k_2, self.k_3, self.k_4

    @property
    def slip_forces(self) -> tuple[float, ...]:
        """Forces at which they slip."""
        return self.W_1, self.W_2, self.W_3, self.W_4


class State(NamedTuple):
    """Position, velocity, deflections."""

    x: Annotated[float, Signal("m", "position", 1e-4)]
    v: Annotated[float, Signal("m/s", "velocity", 0.01)]
    z_1: Travel
    z_2: Travel
    z_3: Travel
    z_4: Travel


class Memory(NamedTuple):
    """Force, and speed of a motion that is given."""

    F: Annotated[float, Signal("N", "force", 500.0)]
    speed: Annotated[float, Signal("m/s", "speed", 0.01)]


class Stimulus(NamedTuple):
    """Demands."""

    F_set: Annotated[float, Signal("N", "force demand", 500.0)]
    speed_set: Annotated[float, Signal("m/s", "speed demand", 0.01)]


class Flow(NamedTuple):
    """Energies."""

    E_source: Annotated[float, Signal("J", "energy of the drive")]
    E_slip: Annotated[float, Signal("J", "loss of slip")]
    E_friction: Annotated[float, Signal("J", "loss of friction")]


class Output(NamedTuple):
    """Recorded signals."""

    x: Annotated[float, Signal("m", "position", 1e-4)]
    v: Annotated[float, Signal("m/s", "velocity", 0.01)]
    z_1: Travel
    z_2: Travel
    z_3: Travel
    z_4: Travel
    F_springs: Annotated[float, Signal("N", "force of the springs", 500.0)]
    slip_1: Annotated[float, Signal("m/s", "slip speed of the first spring", 0.01)]
    E_source: Annotated[float, Signal("J", "energy of the drive")]
    E_slip: Annotated[float, Signal("J", "loss of slip")]
    E_friction: Annotated[float, Signal("J", "loss of friction")]
    E_stored: Annotated[float, Signal("J", "stored energy")]


@dataclass(frozen=True)
class MaxwellSlip(Model):
    """m dv/dt = F - k x - sum k_j z_j - friction; ``moved``: dx/dt is given instead."""

    moved: bool = False
    rubs: bool = False
    loaded: bool = False
    """whether the slip forces grow with the position"""

    name: ClassVar[str] = "maxwell-slip"
    State: ClassVar[Any] = State
    Memory: ClassVar[Any] = Memory
    Stimulus: ClassVar[Any] = Stimulus
    Flow: ClassVar[Any] = Flow
    Output: ClassVar[Any] = Output
    limits: ClassVar[Any] = ()
    stops: ClassVar[Any] = ("z_1", "z_2", "z_3", "z_4")

    @property
    def frictions(self) -> tuple[str, ...]:
        """Return the velocity if it rubs."""
        return ("v",) if self.rubs else ()

    def tasks(self, par: Parameters) -> tuple[Task, ...]:
        """Return the hold."""
        return (Task("hold", par.T_s, lambda x, m, u, p: Memory(u.F_set, u.speed_set)),)

    def mass(self, xe: State, par: Parameters) -> State:
        """Return the mass."""
        return State(1.0, par.m, 1.0, 1.0, 1.0, 1.0)

    def speed(self, x: State, m: Memory) -> float:
        """Return the speed of the motion."""
        return m.speed if self.moved else x.v

    def springs(self, x: State, par: Parameters) -> float:
        """Return the force of all springs."""
        slipping = zip(par.stiffnesses, x[2:], strict=True)
        return par.k * x.x + sum((k * z for k, z in slipping), 0.0)

    def balance(self, x: State, xe: State, m: Memory, par: Parameters, contact: Any) -> State:
        """Return speeds and forces."""
        v = self.speed(x, m)
        force = 0.0 if self.moved else m.F - self.springs(x, par)
        return State(v, force, v, v, v, v)

    def bounds(
        self, x: State, xe: State, m: Memory, par: Parameters, contact: Any
    ) -> tuple[Bounds, ...]:
        """Return those of Coulomb friction."""
        return ((-par.F_c, par.F_c),) if self.rubs else ()

    def growth(self, x: State, par: Parameters) -> Any:
        """Return the factor of the slip forces."""
        return 1.0 + ops.fmax(par.k * x.x, 0.0) / par.F_load if self.loaded else 1.0

    def widths(
        self, x: State, xe: State, m: Memory, par: Parameters, contact: Any
    ) -> tuple[float, ...]:
        """Return the deflections at which the springs slip."""
        pairs = zip(par.slip_forces, par.stiffnesses, strict=True)
        return tuple(W * self.growth(x, par) / k for W, k in pairs)

    def powers(
        self,
        x: State,
        xe: State,
        rate: State,
        m: Memory,
        par: Parameters,
        contact: Any,
        reaction: tuple[float, ...],
    ) -> Flow:
        """Return power of the drive and losses."""
        slips = reaction[-COUNT:]
        growth = self.growth(xe, par)
        pairs = zip(par.slip_forces, slips, strict=True)
        loss = sum((W * growth * ops.fabs(slip) for W, slip in pairs), 0.0)
        force = self.springs(x, par) if self.moved else m.F
        return Flow(force * self.speed(x, m), loss, -reaction[0] * x.v if self.rubs else 0.0 * x.v)

    def output(
        self,
        x: State,
        m: Memory,
        par: Parameters,
        contact: Any,
        reaction: tuple[float, ...],
        flow: Flow,
    ) -> Output:
        """Return what is recorded."""
        slipping = zip(par.stiffnesses, x[2:], strict=True)
        stored = 0.5 * (par.m * x.v * x.v + par.k * x.x * x.x)
        stored = stored + sum((0.5 * k * z * z for k, z in slipping), 0.0)
        return Output(*x, self.springs(x, par), -reaction[-COUNT], *flow, stored)


PARAMETERS = Parameters(
    m=2.0,
    k=2e6,
    F_c=40.0,
    F_load=300.0,
    k_1=4e6,
    k_2=3e6,
    k_3=2e6,
    k_4=1e6,
    W_1=50.0,
    W_2=150.0,
    W_3=300.0,
    W_4=400.0,
    T_s=1e-3,
)
"""the four springs of the specification; elastic spring and mass at choice"""
AMPLITUDE = 1e-4


def given_motion(
    cycles: int = 2,
    step: float = 2e-5,
    par: Parameters = PARAMETERS,
    record: float = 1e-3,
    loaded: bool = False,
    quarter: int = 20,
) -> Run:
    """Return a run in which the position moves to AMPLITUDE and back at constant speed.

    One quarter of a cycle takes ``quarter`` ticks.
    """
    speed = AMPLITUDE / (quarter * par.T_s)

    def stimulus(t: Any) -> Any:
        tick = np.rint(t / par.T_s).astype(int)
        ahead = (tick + quarter) // (2 * quarter) % 2 == 0
        return np.column_stack([np.zeros(t.size), np.where(ahead, speed, -speed)])

    duration = (4 * cycles + 1) * quarter * par.T_s
    return Run(
        MaxwellSlip(moved=True, loaded=loaded),
        par.replace({"k": 1e-9}),
        zeros(State),
        zeros(Memory),
        stimulus,
        duration,
        step,
        record,
    )


def driven(
    step: float = 2e-5,
    par: Parameters = PARAMETERS,
    rubs: bool = False,
    loaded: bool = False,
    duration: float = 0.05,
    record: float = 1e-3,
    force: float = 900.0,
) -> Run:
    """Return a run driven by a force that changes at ticks: two sines."""

    def stimulus(t: Any) -> Any:
        F = force * (np.sin(2.0 * np.pi * 45.0 * t) + 0.4 * np.sin(2.0 * np.pi * 130.0 * t))
        return np.column_stack([F, np.zeros(t.size)])

    return Run(
        MaxwellSlip(rubs=rubs, loaded=loaded),
        par,
        zeros(State),
        zeros(Memory),
        stimulus,
        duration,
        step,
        record,
    )
