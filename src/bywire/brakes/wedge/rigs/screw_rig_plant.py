"""Two motors whose screws push on a force sensor between them: states, wiring, energies."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from bywire.brakes.wedge import drive_train
from bywire.brakes.wedge.drive_train import Command, Demand, Side
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.core import ops
from bywire.core.signals import Signal
from bywire.plant import current_drive, force_sensor, roller_screw, servo_motor, shaft_encoder

Par = WedgeParameters
ON = 1.0  # the rig's power stages are never switched off


class State(NamedTuple):
    """Continuous states of drives, motors and force sensor."""

    demand_1: Annotated[float, Signal("A", "filtered current demand 1", 5.0)]
    sensed_1: Annotated[float, Signal("A", "sensed current 1", 5.0)]
    integral_1: Annotated[float, Signal("1", "integral part of drive 1", 0.1)]
    i_1: Annotated[float, Signal("A", "current 1", 5.0)]
    theta_1: Annotated[float, Signal("rad", "motor angle 1", 3.0)]
    omega_1: Annotated[float, Signal("rad/s", "motor speed 1", 50.0)]
    demand_2: Annotated[float, Signal("A", "filtered current demand 2", 5.0)]
    sensed_2: Annotated[float, Signal("A", "sensed current 2", 5.0)]
    integral_2: Annotated[float, Signal("1", "integral part of drive 2", 0.1)]
    i_2: Annotated[float, Signal("A", "current 2", 5.0)]
    theta_2: Annotated[float, Signal("rad", "motor angle 2", 3.0)]
    omega_2: Annotated[float, Signal("rad/s", "motor speed 2", 50.0)]
    y_F: Annotated[float, Signal("N", "force shown by the sensor", 1000.0)]


class Memory(NamedTuple):
    """What the controllers hold between their sampling instants."""

    theta_1_ref: Annotated[float, Signal("rad", "angle reference 1", 3.0)]
    last_1: Annotated[float, Signal("rad", "encoder 1 at the last sample", 3.0)]
    speed_1: Annotated[float, Signal("rad/s", "measured speed 1", 50.0)]
    i_1_ref: Annotated[float, Signal("A", "current demand 1", 5.0)]
    theta_2_ref: Annotated[float, Signal("rad", "angle reference 2", 3.0)]
    last_2: Annotated[float, Signal("rad", "encoder 2 at the last sample", 3.0)]
    speed_2: Annotated[float, Signal("rad/s", "measured speed 2", 50.0)]
    i_2_ref: Annotated[float, Signal("A", "current demand 2", 5.0)]


class Stimulus(NamedTuple):
    """What the operator demands; ``rig.mode_1`` and ``rig.mode_2`` say which of them acts."""

    theta_1_set: Annotated[float, Signal("rad", "demanded angle 1", 3.0)]
    theta_2_set: Annotated[float, Signal("rad", "demanded angle 2", 3.0)]
    i_1_set: Annotated[float, Signal("A", "current demand 1", 5.0)]
    i_2_set: Annotated[float, Signal("A", "current demand 2", 5.0)]


class Flow(NamedTuple):
    """Integrals over the run."""

    W_electric: Annotated[float, Signal("J", "electrical energy into the motors")]
    E_copper: Annotated[float, Signal("J", "copper loss")]
    E_damping: Annotated[float, Signal("J", "damping of the motors")]
    E_shaft: Annotated[float, Signal("J", "friction of bearings and screws")]
    E_line: Annotated[float, Signal("J", "damping of screws and force sensor")]
    t_stuck: Annotated[float, Signal("s", "time in which both shafts stick")]


def sides(x: State, xe: State, m: Memory, par: Par) -> tuple[Side, Side]:
    """Return both drives and motors; angles are value-only, for the cogging."""
    return (
        Side(
            current_drive.State(x.demand_1, x.sensed_1, x.integral_1),
            servo_motor.State(x.i_1, xe.theta_1, x.omega_1),
            m.i_1_ref,
            par.motor_1,
        ),
        Side(
            current_drive.State(x.demand_2, x.sensed_2, x.integral_2),
            servo_motor.State(x.i_2, xe.theta_2, x.omega_2),
            m.i_2_ref,
            par.motor_2,
        ),
    )


def line(x: State, par: Par) -> force_sensor.Input:
    """Return what acts on the screws and the sensor between them."""
    k = roller_screw.slope(par.screw)
    return force_sensor.Input(
        k * x.theta_1, k * x.theta_2, k * x.omega_1, k * x.omega_2, 2.0 / par.heart.K_S
    )


def force(x: State, par: Par) -> float:
    """Return the force on the sensor [N], compression positive."""
    return force_sensor.force(line(x, par), par.rig.sensor)


def forces(x: State, par: Par) -> tuple[float, float]:
    """Return the axial forces on both screws [N], positive toward clamping."""
    F = force(x, par)
    return (-F, F)


def stuck(x: State) -> float:
    """Return 1 where both shafts stand still, else 0."""
    return ops.where(ops.fabs(x.omega_1) + ops.fabs(x.omega_2) == 0, 1.0, 0.0)


def power(x: State, m: Memory, par: Par) -> float:
    """Return the electrical power into both motors [W]."""
    return sum((drive_train.power(s, ON, par) for s in sides(x, x, m, par)), 0.0)


def rates(x: State, m: Memory, par: Par, reaction: tuple[float, ...]) -> Flow:
    """Return the powers at the midpoint of a substep."""
    both = sides(x, x, m, par)
    return Flow(
        W_electric=power(x, m, par),
        E_copper=sum((servo_motor.copper_loss(s.motor, s.par) for s in both), 0.0),
        E_damping=sum((servo_motor.damping_loss(s.motor, s.par) for s in both), 0.0),
        E_shaft=-(reaction[0] * x.omega_1 + reaction[1] * x.omega_2),
        E_line=force_sensor.power_loss(line(x, par), par.rig.sensor),
        t_stuck=stuck(x),
    )


def stored(x: State, m: Memory, par: Par) -> float:
    """Return the energy stored in windings, rotors, cogging, screws and sensor [J]."""
    motors = (servo_motor.energy(s.motor, s.par) for s in sides(x, x, m, par))
    return sum(motors, 0.0) + force_sensor.energy(line(x, par), par.rig.sensor)


def tick(x: State, m: Memory, u: Stimulus, par: Par) -> Memory:
    """Run the real-time computer once; it serves both motors."""
    first = drive_train.command(
        par.rig.mode_1,
        shaft_encoder.reading(x.theta_1, par.encoder),
        Command(m.theta_1_ref, m.last_1, m.speed_1, m.i_1_ref),
        Demand(u.theta_1_set, u.i_1_set),
        par,
    )
    second = drive_train.command(
        par.rig.mode_2,
        shaft_encoder.reading(x.theta_2, par.encoder),
        Command(m.theta_2_ref, m.last_2, m.speed_2, m.i_2_ref),
        Demand(u.theta_2_set, u.i_2_set),
        par,
    )
    return Memory._make((*first, *second))
