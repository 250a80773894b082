"""The heart of a wedge brake: two screws and a wedge, three coupled contacts, three frictions.

Two controllers, at 1 and 5 kHz, write the same memory. Screw angles are taken as travels, so
that all states are positions and velocities.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, ClassVar, NamedTuple

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
    Stiffness,
    TimeConstant,
)
from bywire.core.signals import Signal
from bywire.simulation.run import Run

Travel = Annotated[float, Signal("m", "travel", 1e-4)]
Velocity = Annotated[float, Signal("m/s", "velocity", 0.02)]
Push = Annotated[float, Signal("N", "force", 1000.0)]
Count = Annotated[float, Signal("1", "count")]


class Parameters(ParameterSet):
    """Screws, wedge, contacts, frictions, controllers."""

    M_S: Mass  # of a motor, as seen at its screw
    M_W: Mass
    K_CAL: Stiffness  # of the caliper, as the wedge sees it
    K_S: Stiffness
    K_W: Stiffness
    K_C: Stiffness
    g: Length
    """free play between a screw and the wedge"""
    g_12: Length
    tau: TimeConstant
    F_S0: Force
    """friction of an unloaded screw"""
    loss: Gain
    """growth of a screw's friction with its axial force"""
    F_W0: Force
    mu: Gain
    """growth of the wedge's friction with the forces on its interfaces"""
    k_p: Stiffness
    k_d: Damping
    F_max: Force
    T_slow: Duration
    T_fast: Duration


class State(NamedTuple):
    """Travels and velocities of screw 1, screw 2 and the wedge."""

    X_1: Travel
    V_1: Velocity
    X_2: Travel
    V_2: Velocity
    x: Travel
    v: Velocity


class Memory(NamedTuple):
    """References of the slow task, forces of the fast one, and who ran when."""

    reference_1: Travel
    reference_2: Travel
    force_1: Push
    force_2: Push
    slow_ticks: Count
    fast_ticks: Count
    slow_seen: Count


class Stimulus(NamedTuple):
    """Demanded travels of both screws."""

    demand_1: Travel
    demand_2: Travel


class Flow(NamedTuple):
    """Energies."""

    E_source: Annotated[float, Signal("J", "work of the motors")]
    E_friction: Annotated[float, Signal("J", "friction loss")]


class Output(NamedTuple):
    """Recorded signals."""

    X_1: Travel
    V_1: Velocity
    X_2: Travel
    V_2: Velocity
    x: Travel
    v: Velocity
    f_1: Push
    f_2: Push
    f_12: Push
    friction_1: Push
    friction_2: Push
    friction_w: Push
    reference_1: Travel
    reference_2: Travel
    force_1: Push
    force_2: Push
    slow_ticks: Count
    fast_ticks: Count
    slow_seen: Count
    E_source: Annotated[float, Signal("J", "work of the motors")]
    E_friction: Annotated[float, Signal("J", "friction loss")]


PARAMETERS = Parameters(
    M_S=1184.0,
    M_W=0.6,
    K_CAL=4e6,
    K_S=6e7,
    K_W=4e7,
    K_C=2e9,
    g=20e-6,
    g_12=30e-6,
    tau=15e-6,
    F_S0=250.0,
    loss=0.54,
    F_W0=20.0,
    mu=0.036,
    k_p=4.2e7,
    k_d=3.6e5,
    F_max=6300.0,
    T_slow=1e-3,
    T_fast=2e-4,
)
AT_REST = State(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
IDLE = Memory(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def _slow(x: State, m: Memory, u: Stimulus, par: Parameters) -> Memory:
    references = {"reference_1": u.demand_1, "reference_2": u.demand_2}
    return m._replace(**references, slow_ticks=m.slow_ticks + 1.0)


def _fast(x: State, m: Memory, u: Stimulus, par: Parameters) -> Memory:
    def drive(at: float, X: float, V: float) -> float:
        return ops.clip(par.k_p * (at - X) - par.k_d * V, -par.F_max, par.F_max)

    return m._replace(
        force_1=drive(m.reference_1, x.X_1, x.V_1),
        force_2=drive(m.reference_2, x.X_2, x.V_2),
        fast_ticks=m.fast_ticks + 1.0,
        slow_seen=m.slow_ticks,
    )


class ThreeContacts(Model):
    """The model."""

    name: ClassVar[str] = "three-contacts"
    State: ClassVar = State
    Memory: ClassVar = Memory
    Stimulus: ClassVar = Stimulus
    Flow: ClassVar = Flow
    Output: ClassVar = Output
    frictions: ClassVar[tuple[str, ...]] = ("V_1", "V_2", "v")
    limits: ClassVar[tuple[str, ...]] = ()
    usually_open: ClassVar[tuple[bool, ...]] = (False,)

    def tasks(self, par: Parameters) -> tuple[Task, ...]:
        """Return both controllers; the slow one runs first where both are due."""
        return (
            Task("slow", par.T_slow, _slow),
            Task("fast", par.T_fast, _fast),
        )

    def mass(self, xe: State, par: Parameters) -> State:
        """Return the masses."""
        return State(1.0, par.M_S, 1.0, par.M_S, 1.0, par.M_W)

    def balance(
        self, x: State, xe: State, m: Memory, par: Parameters, contact: tuple[float, ...]
    ) -> State:
        """Return velocities and forces."""
        f_1, f_2, f_12 = contact
        screw_1, screw_2 = m.force_1 + f_1 - f_12, m.force_2 + f_12 - f_2
        return State(x.V_1, screw_1, x.V_2, screw_2, x.v, f_2 - f_1 - par.K_CAL * x.x)

    def bounds(
        self, x: State, xe: State, m: Memory, par: Parameters, contact: tuple[float, ...]
    ) -> tuple[Bounds, ...]:
        """Return the friction bounds, which grow with the contact forces."""
        f_1, f_2, f_12 = contact
        screw_1 = par.F_S0 + par.loss * ops.fabs(f_1 - f_12)
        screw_2 = par.F_S0 + par.loss * ops.fabs(f_12 - f_2)
        wedge = par.F_W0 + par.mu * (f_1 + f_2)
        return ((-screw_1, screw_1), (-screw_2, screw_2), (-wedge, wedge))

    def compliance(self, par: Parameters) -> tuple[Matrix, ...]:
        """Return the compliances of the three contacts, coupled by the screws."""
        s, w = 1.0 / par.K_S, 1.0 / par.K_W
        tips = 2.0 * s + 1.0 / par.K_C
        return (((s + w, 0.0, -s), (0.0, s + w, -s), (-s, -s, tips)),)

    def gap(self, x: State, xe: State, par: Parameters) -> tuple[tuple[float, ...], ...]:
        """Return the damped overlaps."""
        X_1, X_2 = x.X_1 + par.tau * x.V_1, x.X_2 + par.tau * x.V_2
        wedge = x.x + par.tau * x.v
        return ((wedge - X_1 - par.g, X_2 - wedge - par.g, X_1 - X_2 - par.g_12),)

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
        """Return the motors' power and the friction losses."""
        friction = reaction[0] * x.V_1 + reaction[1] * x.V_2 + reaction[2] * x.v
        return Flow(m.force_1 * x.V_1 + m.force_2 * x.V_2, -friction)

    def output(
        self,
        x: State,
        m: Memory,
        par: Parameters,
        contact: tuple[float, ...],
        reaction: tuple[float, ...],
        flow: Flow,
    ) -> Any:
        """Return what is recorded."""
        return Output(*x, *contact, *reaction, *m, *flow)


def wiggled(t: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return demands that move the wedge to and fro while the preload comes, goes and turns."""
    common = 80e-6 * np.sin(2.0 * math.pi * 24.0 * t)
    apart = 60e-6 * np.sin(2.0 * math.pi * 14.0 * t)
    return np.stack([common - apart, common + apart], axis=1)


def heart(
    duration: float,
    step: float = 20e-6,
    record: float = 1e-4,
    stiffer: float = 1.0,
    **changes: float,
) -> Run:
    """Return a run from rest, with contacts stiffer by a factor and other changed parameters."""
    stiff = {name: getattr(PARAMETERS, name) * stiffer for name in ("K_S", "K_W", "K_C")}
    par = PARAMETERS.replace(stiff | changes)
    return Run(ThreeContacts(), par, AT_REST, IDLE, wiggled, duration, step, record)
