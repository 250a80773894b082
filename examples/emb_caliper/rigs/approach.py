"""Approach: the linear benchmark of an EMB that closes its clearance under position control.

This is the model of Strathmann and Oehlerking, Verifying properties of an electro-mechanical
braking system, ARCH 2015, in the version from competitions of verification tools. It has a winding,
a rotor without inertia against viscous friction, a gear, and a sampled, unlimited PI controller.
"""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, NamedTuple

from pydantic import Field

from bywire.authoring import (
    Duration,
    Length,
    Model,
    ParameterSet,
    RotaryDamping,
    Signal,
    Task,
    Unit,
    zeros,
)
from bywire.plant import dc_motor

Ratio = Annotated[float, Unit("rad/m", 1e3), Field(gt=0, allow_inf_nan=False)]
VoltagePerLength = Annotated[float, Unit("V/m", 1e5), Field(ge=0, allow_inf_nan=False)]
VoltagePerLengthTime = Annotated[float, Unit("V/(m*s)", 1e4), Field(ge=0, allow_inf_nan=False)]


class ApproachParameters(ParameterSet):
    """Constants of the benchmark."""

    motor: dc_motor.Parameters
    d_rot: RotaryDamping
    """viscous friction at the motor"""
    i_gear: Ratio
    """motor angle per travel"""
    k_p: VoltagePerLength
    """proportional gain of the position controller"""
    k_i: VoltagePerLengthTime
    """integral gain"""
    T_sample: Duration
    """sample time"""
    x_0: Length
    """travel at which the pads touch the disc"""


class State(NamedTuple):
    """State of the simulation."""

    i: Annotated[float, Signal("A", "motor current", 100.0)]
    x: Annotated[float, Signal("m", "travel", 5e-3)]


class Memory(NamedTuple):
    """Memory of the controller."""

    x_e: Annotated[float, Signal("m", "error", 5e-3)]
    x_c: Annotated[float, Signal("m*s", "integral of the error", 1e-4)]


class Stimulus(NamedTuple):
    """External inputs."""

    x_set: Annotated[float, Signal("m", "travel demand", 5e-3)]


class Flow(NamedTuple):
    """Integrals over the run."""

    E_copper: Annotated[float, Signal("J", "copper loss")]


class Output(NamedTuple):
    """Recorded signals."""

    x: Annotated[float, Signal("m", "travel", 5e-3)]
    x_set: Annotated[float, Signal("m", "travel demand", 5e-3)]
    i: Annotated[float, Signal("A", "motor current", 100.0)]
    E_copper: Annotated[float, Signal("J", "copper loss")]


def tick(x: State, m: Memory, u: Stimulus, par: ApproachParameters) -> Memory:
    """Compute the error, and add it to its integral."""
    error = u.x_set - x.x
    return Memory(x_e=error, x_c=m.x_c + par.T_sample * error)


def speed(x: State, par: ApproachParameters) -> float:
    """Return the motor speed [rad/s], which is torque divided by viscous friction."""
    return dc_motor.output(dc_motor.State(x.i), par.motor).torque / par.d_rot


class Approach(Model):
    """The motor moves the piston through the clearance, without contact."""

    name: ClassVar[str] = "emb-approach"
    State: ClassVar = State
    Memory: ClassVar = Memory
    Stimulus: ClassVar = Stimulus
    Flow: ClassVar = Flow
    Output: ClassVar = Output

    def tasks(self, par: ApproachParameters) -> tuple[Task, ...]:
        return (Task("position", par.T_sample, tick),)

    def mass(self, xe: State, par: ApproachParameters) -> State:
        return State(dc_motor.mass(dc_motor.State(xe.i), par.motor).i, 1.0)

    def balance(
        self, x: State, xe: State, m: Memory, par: ApproachParameters, contact: tuple[float, ...]
    ) -> State:
        omega, v = speed(x, par), par.k_p * m.x_e + par.k_i * m.x_c
        motor = dc_motor.balance(dc_motor.State(x.i), dc_motor.Input(v, omega), par.motor)
        return State(motor.i, omega / par.i_gear)

    def powers(
        self,
        x: State,
        xe: State,
        rate: State,
        m: Memory,
        par: ApproachParameters,
        contact: tuple[float, ...],
        reaction: tuple[float, ...],
    ) -> Flow:
        return Flow(dc_motor.power_loss(dc_motor.State(x.i), par.motor))

    def output(
        self,
        x: State,
        m: Memory,
        par: ApproachParameters,
        contact: tuple[float, ...],
        reaction: tuple[float, ...],
        flow: Flow,
    ) -> Output:
        return Output(x.x, m.x_e + x.x, x.i, flow.E_copper)


def at_rest() -> tuple[Any, Any]:
    """Return state and memory of the retracted piston without current."""
    return zeros(State), zeros(Memory)
