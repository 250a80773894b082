"""Drive train of one motor: current drive, motor, bearings and screw, wherever it is mounted."""

from __future__ import annotations

from typing import Annotated, Literal, NamedTuple

from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.control import position_pd
from bywire.core.model import Bounds
from bywire.core.signals import Signal
from bywire.plant import axial_bearing, current_drive, roller_screw, servo_motor

Par = WedgeParameters
Rows = tuple[float, ...]


class Side(NamedTuple):
    """What belongs to one motor."""

    drive: current_drive.State
    motor: servo_motor.State
    i_ref: Annotated[float, Signal("A", "current demand", 5.0)]
    par: servo_motor.Parameters


class Command(NamedTuple):
    """What the real-time computer holds for one motor."""

    theta_ref: Annotated[float, Signal("rad", "angle reference", 3.0)]
    last: Annotated[float, Signal("rad", "encoder at the last sample", 3.0)]
    speed: Annotated[float, Signal("rad/s", "measured speed", 50.0)]
    i_ref: Annotated[float, Signal("A", "current demand", 5.0)]


class Demand(NamedTuple):
    """What a rig's operator asks of one motor; which of them acts depends on its mode."""

    theta: Annotated[float, Signal("rad", "demanded angle", 3.0)]
    i: Annotated[float, Signal("A", "demanded current", 5.0)]


def drive_input(s: Side, on: float) -> current_drive.Input:
    """Return what a drive sees; ``on`` is 1 while its power stage is on."""
    emf = servo_motor.torque_constant(s.par) * s.motor.omega
    return current_drive.Input(i_ref=s.i_ref, i=s.motor.i, emf=emf, on=on)


def voltage(s: Side, on: float, par: Par) -> float:
    """Return a motor's voltage [V]."""
    return current_drive.output(s.drive, drive_input(s, on), par.drive).v


def power(s: Side, on: float, par: Par) -> float:
    """Return the electrical power into a motor [W]."""
    return voltage(s, on, par) * s.motor.i


def mass(motor: servo_motor.Parameters) -> Rows:
    """Return the factors of the six derivatives: drive (3), winding, angle, speed."""
    return (1.0, 1.0, 1.0, *servo_motor.mass(motor))


def balance(s: Side, on: float, force: float, par: Par) -> Rows:
    """Return the right-hand sides of the six equations, without dry friction.

    Parameters
    ----------
    force
        Axial force on the screw [N], positive toward clamping.
    """
    load = roller_screw.load_torque(roller_screw.Input(force, 0.0), par.screw)
    v = voltage(s, on, par)
    rate = current_drive.rate(s.drive, drive_input(s, on), par.drive)
    return (*rate, *servo_motor.balance(s.motor, servo_motor.Input(v, load, 0.0), s.par))


def bounds(s: Side, force: float, par: Par) -> Bounds:
    """Return the limits [N m] of the dry friction of bearings and screw on one shaft."""
    bearing = bearing_friction(s, force, par)
    screw = screw_friction(s, force, par)
    return (-(bearing + screw.T_p), bearing + screw.T_n)


def bearing_friction(s: Side, force: float, par: Par) -> float:
    """Return the bearing's friction torque [N m]."""
    return axial_bearing.friction(axial_bearing.Input(force, s.motor.omega), par.bearing)


def screw_friction(s: Side, force: float, par: Par) -> roller_screw.Output:
    """Return the screw's friction torques [N m] in both directions."""
    torque = servo_motor.torque_constant(s.par) * s.motor.i
    return roller_screw.friction(roller_screw.Input(force, torque), par.screw)


def command(
    mode: Literal["position", "current"], theta: float, held: Command, u: Demand, par: Par
) -> Command:
    """Run the real-time computer once for one motor of a rig.

    Parameters
    ----------
    mode
        Whether the motor's position is controlled, or its drive is handed the demanded current.
    theta
        What the encoder shows [rad].
    """
    x, out = position_pd.output(
        position_pd.State(held.last, held.speed),
        position_pd.Input(u.theta, 0.0 * theta, theta),
        par.control.T_fast,
        par.control.position,
    )
    i_ref = out.i if mode == "position" else u.i
    return Command(theta_ref=u.theta, last=x.last, speed=x.speed, i_ref=i_ref)
