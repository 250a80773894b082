"""A single motor on its rig: states, wiring, friction, energies, what is recorded."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from bywire.brakes.wedge import drive_train
from bywire.brakes.wedge.drive_train import Command, Demand, Side
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.core import ops
from bywire.core.model import Bounds
from bywire.core.signals import Signal
from bywire.plant import current_drive, servo_motor, shaft_encoder

Par = WedgeParameters
ON = 1.0  # the rig's power stage is never switched off
NUT = 0.0  # net axial force: a preloaded nut is braced against itself


class State(NamedTuple):
    """Continuous states of drive and motor."""

    demand_1: Annotated[float, Signal("A", "filtered current demand 1", 5.0)]
    sensed_1: Annotated[float, Signal("A", "sensed current 1", 5.0)]
    integral_1: Annotated[float, Signal("1", "integral part of drive 1", 0.1)]
    i_1: Annotated[float, Signal("A", "current 1", 5.0)]
    theta_1: Annotated[float, Signal("rad", "motor angle 1", 3.0)]
    omega_1: Annotated[float, Signal("rad/s", "motor speed 1", 50.0)]


class Memory(NamedTuple):
    """What the controller holds between its sampling instants."""

    theta_1_ref: Annotated[float, Signal("rad", "angle reference 1", 3.0)]
    last_1: Annotated[float, Signal("rad", "encoder 1 at the last sample", 3.0)]
    speed_1: Annotated[float, Signal("rad/s", "measured speed 1", 50.0)]
    i_1_ref: Annotated[float, Signal("A", "current demand 1", 5.0)]


class Stimulus(NamedTuple):
    """What the operator demands; ``rig.mode_1`` says which of them acts."""

    theta_1_set: Annotated[float, Signal("rad", "demanded angle 1", 3.0)]
    i_1_set: Annotated[float, Signal("A", "current demand 1", 5.0)]


class Flow(NamedTuple):
    """Integrals over the run."""

    W_electric: Annotated[float, Signal("J", "electrical energy into the motor")]
    E_copper: Annotated[float, Signal("J", "copper loss")]
    E_damping: Annotated[float, Signal("J", "damping of the motor")]
    E_shaft: Annotated[float, Signal("J", "friction of bearings, screw and clamp")]
    t_stuck: Annotated[float, Signal("s", "time in which the shaft sticks")]


class Output(NamedTuple):
    """What a recording of the rig holds."""

    theta_1_ref: Annotated[float, Signal("rad", "angle reference 1", 3.0)]
    theta_1: Annotated[float, Signal("rad", "motor angle 1", 3.0)]
    q_1: Annotated[float, Signal("rad", "angle shown by encoder 1", 3.0)]
    omega_1: Annotated[float, Signal("rad/s", "motor speed 1", 50.0)]
    i_1_ref: Annotated[float, Signal("A", "current demand 1", 5.0)]
    i_1: Annotated[float, Signal("A", "current 1", 5.0)]
    sat_current: Annotated[float, Signal("1", "current demand saturated")]
    voltage_1: Annotated[float, Signal("V", "motor voltage 1", 10.0)]
    T_fr_1: Annotated[float, Signal("N*m", "friction torque 1", 0.1)]
    stuck: Annotated[float, Signal("1", "shaft stuck")]
    P_el: Annotated[float, Signal("W", "electrical power", 50.0)]
    E_source: Annotated[float, Signal("J", "electrical energy into the motor")]
    E_copper: Annotated[float, Signal("J", "copper loss")]
    E_damping: Annotated[float, Signal("J", "damping of the motor")]
    E_shaft: Annotated[float, Signal("J", "friction of bearings, screw and clamp")]
    E_stored: Annotated[float, Signal("J", "stored energy")]
    t_stuck: Annotated[float, Signal("s", "time in which the shaft sticks")]


def side(x: State, xe: State, m: Memory, par: Par) -> Side:
    """Return drive and motor; the angle is value-only, for the cogging."""
    return Side(
        current_drive.State(x.demand_1, x.sensed_1, x.integral_1),
        servo_motor.State(x.i_1, xe.theta_1, x.omega_1),
        m.i_1_ref,
        par.motor_1,
    )


def dummy(par: Par) -> float:
    """Return the inertia [kg m^2] that the rig adds; the screw's own is in the motor's."""
    return par.rig.J_dummy if par.rig.load == "dummy" else 0.0 * par.rig.J_dummy


def friction(s: Side, par: Par) -> Bounds:
    """Return the limits of the dry friction [N m] of bearings, screw and clamp.

    Notes
    -----
    A preloaded nut has two halves that push on each other through the screw: whichever way it
    turns, one half drives and the other is driven. Both rub, and no net torque is left.
    """
    T_p = T_n = drive_train.bearing_friction(s, NUT, par)
    if par.rig.load == "screw":
        F_0 = par.rig.F_0
        halves = [drive_train.screw_friction(s, force, par) for force in (F_0, -F_0)]
        # A loss by the motor's torque does not see the preload: it must not count twice.
        once = drive_train.screw_friction(s, 0.0 * F_0, par)
        T_p = T_p + halves[0].T_p + halves[1].T_p - once.T_p
        T_n = T_n + halves[0].T_n + halves[1].T_n - once.T_n
    if par.rig.clamp == "closed":
        T_p, T_n = T_p + par.rig.T_clamp, T_n + par.rig.T_clamp
    return (-T_p, T_n)


def current_limit(par: Par) -> float:
    """Return the limit [A] of the current demand: the drive's, or a lower one of the control."""
    if par.rig.mode_1 == "position":
        return ops.fmin(par.control.position.i_max, par.drive.i_max)
    return par.drive.i_max


def rates(x: State, m: Memory, par: Par, reaction: float) -> Flow:
    """Return the powers at the midpoint of a substep.

    Parameters
    ----------
    reaction
        Friction torque on the shaft [N m].
    """
    s = side(x, x, m, par)
    return Flow(
        W_electric=drive_train.power(s, ON, par),
        E_copper=servo_motor.copper_loss(s.motor, s.par),
        E_damping=servo_motor.damping_loss(s.motor, s.par),
        E_shaft=-reaction * x.omega_1,
        t_stuck=ops.where(x.omega_1 == 0, 1.0, 0.0),
    )


def instant(x: State, m: Memory, par: Par, reaction: float, flow: Flow) -> Output:
    """Return what is recorded at an instant.

    Parameters
    ----------
    reaction
        Friction torque on the shaft in the last substep [N m].
    flow
        Integrals since the start.
    """
    s = side(x, x, m, par)
    own = {
        "q_1": shaft_encoder.reading(x.theta_1, par.encoder),
        "sat_current": ops.where(ops.fabs(m.i_1_ref) >= current_limit(par), 1.0, 0.0),
        "voltage_1": drive_train.voltage(s, ON, par),
        "T_fr_1": -reaction,
        "stuck": ops.where(x.omega_1 == 0, 1.0, 0.0),
        "P_el": drive_train.power(s, ON, par),
        "E_source": flow.W_electric,
        "E_stored": servo_motor.energy(s.motor, s.par) + 0.5 * dummy(par) * x.omega_1 * x.omega_1,
    }
    for part in (x, m, flow):
        own |= {k: v for k, v in part._asdict().items() if k in Output._fields}
    return Output(**own)


def tick(x: State, m: Memory, u: Stimulus, par: Par) -> Memory:
    """Run the real-time computer once."""
    theta = shaft_encoder.reading(x.theta_1, par.encoder)
    return Memory._make(
        drive_train.command(
            par.rig.mode_1, theta, Command._make(m), Demand(u.theta_1_set, u.i_1_set), par
        )
    )
