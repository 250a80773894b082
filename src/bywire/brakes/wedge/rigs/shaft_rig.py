"""Rig of a single motor with a dummy shaft or a preloaded screw, its shaft free or clamped.

Source: R. Roberts, M. Schautt, H. Hartmann, B. Gombert, "Modelling and Validation of the
Mechatronic Wedge Brake", SAE, 2003, sections "Motor & rollerscrew alone", "Motor current loop".
"""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, NamedTuple, Self

from bywire.brakes.wedge import drive_train
from bywire.brakes.wedge.drive_train import Command, Demand
from bywire.brakes.wedge.parameters import RigParameters, WedgeParameters
from bywire.core import ops
from bywire.core.assembly import Assembly
from bywire.core.model import Bounds, Task
from bywire.core.parts import Integral, Part, Shown
from bywire.core.signals import Role, Signal
from bywire.plant import current_drive, driven_rotor, roller_screw, servo_motor, shaft_encoder

Par = WedgeParameters
ON = 1.0  # the rig's power stage is never switched off
NUT = 0.0  # net axial force: a preloaded nut is braced against itself


class Memory(NamedTuple):
    """Memory of the controller between its samples."""

    theta_1_ref: Annotated[float, Signal("rad", "angle reference 1", 3.0)]
    last_1: Annotated[float, Signal("rad", "encoder 1 at the last sample", 3.0)]
    speed_1: Annotated[float, Signal("rad/s", "measured speed 1", 50.0)]
    i_1_ref: Annotated[float, Signal("A", "current demand 1", 5.0)]


class Stimulus(NamedTuple):
    """Demands of the operator. ``rig.mode_1`` selects the active demand."""

    theta_1_set: Annotated[float, Signal("rad", "angle demand 1", 3.0)]
    i_1_set: Annotated[float, Signal("A", "current demand 1", 5.0)]


class ShaftRig(Assembly[WedgeParameters, Memory]):
    """Model of the rig.

    It has one dry friction, of bearings, screw and clamp together.
    """

    name: ClassVar[str] = "shaft-rig"
    Memory: ClassVar = Memory
    Stimulus: ClassVar = Stimulus
    frictions: ClassVar[tuple[str, ...]] = ("omega_1",)

    W_electric = Integral("J", "electrical energy into the motor")
    drive = Part(current_drive, suffix="_1")
    motor = Part(
        servo_motor,
        par="motor_1",
        suffix="_1",
        fixed=("theta",),
        loss={"E_copper": "copper_loss", "E_damping": "damping_loss"},
    )
    E_shaft = Integral(
        "J", "friction of bearings, screw and clamp", role=Role("sink", "bearings and screws")
    )
    t_stuck = Integral("s", "time during which the shaft sticks", role=Role("standstill"))
    q_1 = Shown("rad", "angle from encoder 1", 3.0)
    sat_current = Shown("1", "current demand saturated")
    voltage_1 = Shown("V", "motor voltage 1", 10.0)
    T_fr_1 = Shown("N*m", "friction torque 1", 0.1)
    stuck = Shown("1", "shaft stuck")
    P_el = Shown("W", "electrical power", 50.0)
    E_source = Shown("J", "electrical energy into the motor", role=Role("source", "source"))

    records: ClassVar[tuple[str, ...]] = (
        "theta_1_ref",
        "theta_1",
        "q_1",
        "omega_1",
        "i_1_ref",
        "i_1",
        "sat_current",
        "voltage_1",
        "T_fr_1",
        "stuck",
        "P_el",
        "E_source",
        "E_copper",
        "E_damping",
        "E_shaft",
        "E_stored",
        "t_stuck",
    )

    def wire(self, w: Self) -> None:
        """Connect drive and motor."""
        drive_train.wire(w.drive, w.motor, w.m.i_1_ref, ON, NUT, w.par)

    def mass(self, xe: Any, par: Par) -> Any:
        """Return the inductance and the inertia, including the dummy shaft."""
        motor = super().mass(xe, par)
        return motor._replace(omega_1=motor.omega_1 + _dummy_inertia(par.rig))

    def stored(self, w: Self) -> Any:
        """Return the energy in motor and dummy shaft [J]."""
        omega = w.motor.x.omega
        return super().stored(w) + 0.5 * _dummy_inertia(w.par.rig) * omega * omega

    def friction(self, w: Self) -> tuple[Bounds, ...]:
        """Return the friction limits on the shaft."""
        return (friction(w.motor.x.omega, drive_train.torque(w.motor), w.par),)

    def power(self, w: Self) -> dict[str, float]:
        """Return the input power and the friction power."""
        omega = w.motor.x.omega
        return {
            "W_electric": drive_train.power(w.motor),
            "E_shaft": -w.reaction[0] * omega,
            "t_stuck": ops.where(omega == 0, 1.0, 0.0),
        }

    def record(self, w: Self) -> dict[str, float]:
        """Return the recorded signals other than states and losses."""
        limited = ops.fabs(w.m.i_1_ref) >= _current_limit(w.par)
        return {
            "q_1": shaft_encoder.reading(w.motor.x.theta, w.par.encoder),
            "sat_current": ops.where(limited, 1.0, 0.0),
            "voltage_1": w.motor.u.v,
            "T_fr_1": -w.reaction[0],
            "stuck": ops.where(w.motor.x.omega == 0, 1.0, 0.0),
            "P_el": drive_train.power(w.motor),
            "E_source": w.flow.W_electric,
        }

    def tasks(self, par: Par) -> tuple[Task, ...]:
        """Return the controller's task."""
        return (Task(par.rig.mode_1, par.control.T_fast, tick),)


def friction(omega: float, torque: float, par: Par) -> Bounds:
    """Return the limits of the dry friction [N m] in bearings, screw and clamp.

    ``omega``, ``torque``: shaft speed [rad/s], motor torque [N m].

    Notes
    -----
    A preloaded nut has two halves that push on each other through the screw. In either direction
    of rotation, one half drives and the other is driven. Both rub, and their net torque is zero.
    """
    T_p = T_n = drive_train.bearing_friction(omega, NUT, par)
    if par.rig.load == "screw":
        F_0 = par.rig.F_0
        halves = [drive_train.screw_friction(torque, force, par) for force in (F_0, -F_0)]
        # A loss due to motor torque does not depend on the preload and must not count twice.
        once = drive_train.screw_friction(torque, 0.0 * F_0, par)
        T_p = T_p + halves[0].T_p + halves[1].T_p - once.T_p
        T_n = T_n + halves[0].T_n + halves[1].T_n - once.T_n
    if par.rig.clamp == "closed":
        T_p, T_n = T_p + par.rig.T_clamp, T_n + par.rig.T_clamp
    return (-T_p, T_n)


def _dummy_inertia(par: RigParameters) -> float:
    """Return the inertia [kg m^2] of the rig. The motor's inertia includes the screw."""
    return par.J_dummy if par.load == "dummy" else 0.0 * par.J_dummy


def _current_limit(par: Par) -> float:
    """Return the limit [A] of the current demand, from the drive or the position control."""
    if par.rig.mode_1 == "position":
        return ops.fmin(par.control.position.i_max, par.drive.i_max)
    return par.drive.i_max


def tick(x: Any, m: Memory, u: Stimulus, par: Par) -> Memory:
    """Run the real-time computer once."""
    theta = shaft_encoder.reading(x.theta_1, par.encoder)
    return Memory._make(
        drive_train.command(
            par.rig.mode_1, theta, Command._make(m), Demand(u.theta_1_set, u.i_1_set), par
        )
    )


# --- One shaft alone, with known current and known axial force


class Load(NamedTuple):
    """Current and force on the shaft, held from one sample to the next."""

    i: Annotated[float, Signal("A", "motor current", 5.0)]
    F: Annotated[float, Signal("N", "axial force on the screw", 1000.0)]


class DrivenShaft(Assembly[WedgeParameters, Load]):
    """Model of one shaft for identification. It needs no drive, because the current is measured.

    It has one dry friction, of bearings and screw together. ``rig.load`` determines whether the
    inertia of the dummy shaft counts. There is no cogging if ``motor_1.T_cog`` is zero.
    """

    name: ClassVar[str] = "driven-shaft"
    Memory: ClassVar = Load
    Stimulus: ClassVar = Load
    frictions: ClassVar[tuple[str, ...]] = ("omega",)

    rotor = Part(driven_rotor, par="motor_1", fixed=("theta",))
    E_shaft = Integral(
        "J", "friction of bearings and screw", role=Role("sink", "bearings and screws")
    )
    records: ClassVar[tuple[str, ...]] = ("theta", "omega")

    def wire(self, w: Self) -> None:
        """Apply the measured current and force to the shaft."""
        load = roller_screw.load_torque(roller_screw.Input(w.m.F, 0.0), w.par.screw)
        w.rotor.u = driven_rotor.Input(i=w.m.i, load=load, friction=0.0)

    def mass(self, xe: Any, par: Par) -> Any:
        """Return the inertia, including the dummy shaft."""
        rotor = super().mass(xe, par)
        return rotor._replace(omega=rotor.omega + _dummy_inertia(par.rig))

    def friction(self, w: Self) -> tuple[Bounds, ...]:
        """Return the friction limits on the shaft."""
        torque = servo_motor.torque_constant(w.rotor.par) * w.m.i
        return (drive_train.bounds(w.rotor.x.omega, torque, w.m.F, w.par),)

    def power(self, w: Self) -> dict[str, float]:
        """Return the friction power."""
        return {"E_shaft": -w.reaction[0] * w.rotor.x.omega}

    def tasks(self, par: Par) -> tuple[Task, ...]:
        """Return the task that holds the measured current and force."""
        return (Task("hold", par.control.T_fast, hold),)


def hold(x: Any, m: Load, u: Load, par: Par) -> Load:
    """Hold the measured current and force."""
    return u
