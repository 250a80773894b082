"""Drive train of one motor in the brake or on a rig: current drive, motor, bearings and screw."""

from __future__ import annotations

from typing import Annotated, Literal, NamedTuple

from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.control import position_pd
from bywire.core import ops
from bywire.core.model import Bounds
from bywire.core.signals import Signal
from bywire.core.wires import Wired
from bywire.plant import axial_bearing, current_drive, roller_screw, servo_motor

Par = WedgeParameters
Drive = Wired[current_drive.State, current_drive.Input, None, current_drive.Parameters]
Motor = Wired[servo_motor.State, servo_motor.Input, None, servo_motor.Parameters]


class Command(NamedTuple):
    """Memory of the real-time computer for one motor."""

    theta_ref: Annotated[float, Signal("rad", "angle reference", 3.0)]
    last: Annotated[float, Signal("rad", "encoder at the last sample", 3.0)]
    speed: Annotated[float, Signal("rad/s", "measured speed", 50.0)]
    i_ref: Annotated[float, Signal("A", "current demand", 5.0)]


class Demand(NamedTuple):
    """A rig operator's demands on one motor. The motor's mode selects the active demand."""

    theta: Annotated[float, Signal("rad", "angle demand", 3.0)]
    i: Annotated[float, Signal("A", "current demand", 5.0)]


def wire(drive: Drive, motor: Motor, i_ref: float, on: float, force: float, par: Par) -> None:
    """Connect one motor to its drive and its screw.

    ``i_ref``: current demand [A]; ``on``: 1 while the power stage is on; ``force``: axial force on
    the screw [N], positive toward clamping.
    """
    emf = servo_motor.torque_constant(motor.par) * motor.x.omega
    drive.u = current_drive.Input(i_ref=i_ref, i=motor.x.i, emf=emf, on=on)
    v = current_drive.output(drive.x, drive.u, drive.par).v
    load = roller_screw.load_torque(roller_screw.Input(force, 0.0), par.screw)
    motor.u = servo_motor.Input(v, load, 0.0)


def power(motor: Motor) -> float:
    """Return the electrical power into a motor [W]."""
    return motor.u.v * motor.x.i


def measured_power(drive: Drive, motor: Motor, i_ref: float, on: float) -> float:
    """Return the electrical power into a motor [W] for measurements, from predicted values."""
    emf = servo_motor.torque_constant(motor.par) * motor.xe.omega
    u = current_drive.Input(i_ref=i_ref, i=motor.xe.i, emf=emf, on=on)
    return current_drive.output(drive.xe, u, drive.par).v * motor.xe.i


def torque(motor: Motor) -> float:
    """Return the electromagnetic torque of a motor [N m]."""
    return servo_motor.torque_constant(motor.par) * motor.x.i


def bounds(omega: float, torque: float, force: float, par: Par) -> Bounds:
    """Return the limits [N m] of the dry friction in bearings and screw on one shaft.

    ``omega``, ``torque``, ``force``: shaft speed [rad/s], motor torque [N m], axial force on the
    screw [N].
    """
    bearing = bearing_friction(omega, force, par)
    screw = screw_friction(torque, force, par)
    return (-(bearing + screw.T_p), bearing + screw.T_n)


def bearing_friction(omega: float, force: float, par: Par) -> float:
    """Return the bearing's friction torque [N m]."""
    return axial_bearing.friction(axial_bearing.Input(force, omega), par.bearing)


def screw_friction(torque: float, force: float, par: Par) -> roller_screw.Output:
    """Return the screw's friction torques [N m] in both directions."""
    return roller_screw.friction(roller_screw.Input(force, torque), par.screw)


def command(
    mode: Literal["position", "current"], theta: float, held: Command, u: Demand, par: Par
) -> Command:
    """Run the real-time computer once for one motor of a rig.

    ``mode``: "position" controls the motor position, "current" passes the demanded current to
    the drive; ``theta``: encoder reading [rad].
    """
    x, out = position_pd.output(
        position_pd.State(held.last, held.speed),
        position_pd.Input(u.theta, 0.0 * theta, theta),
        par.control.T_fast,
        par.control.position,
    )
    i_ref = out.i if mode == "position" else ops.clip(u.i, -par.drive.i_max, par.drive.i_max)
    return Command(theta_ref=u.theta, last=x.last, speed=x.speed, i_ref=i_ref)
