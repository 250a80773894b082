"""Rig of two motors that drive their screws against each other, through a force sensor.

Source: R. Roberts, M. Schautt, H. Hartmann, B. Gombert, "Modelling and Validation of the
Mechatronic Wedge Brake", SAE, 2003, sections "Roller-screw efficiency", "Drive train stiffnesses",
"Force fight tests".
"""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, NamedTuple, Self

from bywire.brakes.wedge import drive_train
from bywire.brakes.wedge.drive_train import Command, Demand
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.core import ops
from bywire.core.assembly import Assembly
from bywire.core.model import Bounds, Task
from bywire.core.parts import Integral, Part, Shown, Wire
from bywire.core.signals import Role, Signal
from bywire.plant import current_drive, force_sensor, roller_screw, servo_motor, shaft_encoder

Par = WedgeParameters
ON = 1.0  # the rig's power stages are never switched off
LOSSES = {"E_copper": "copper_loss", "E_damping": "damping_loss"}


class Memory(NamedTuple):
    """Memory of the controllers between their samples."""

    theta_1_ref: Annotated[float, Signal("rad", "angle reference 1", 3.0)]
    last_1: Annotated[float, Signal("rad", "encoder 1 at the last sample", 3.0)]
    speed_1: Annotated[float, Signal("rad/s", "measured speed 1", 50.0)]
    i_1_ref: Annotated[float, Signal("A", "current demand 1", 5.0)]
    theta_2_ref: Annotated[float, Signal("rad", "angle reference 2", 3.0)]
    last_2: Annotated[float, Signal("rad", "encoder 2 at the last sample", 3.0)]
    speed_2: Annotated[float, Signal("rad/s", "measured speed 2", 50.0)]
    i_2_ref: Annotated[float, Signal("A", "current demand 2", 5.0)]


class Stimulus(NamedTuple):
    """Demands of the operator. ``rig.mode_1`` and ``rig.mode_2`` select the active demands."""

    theta_1_set: Annotated[float, Signal("rad", "angle demand 1", 3.0)]
    theta_2_set: Annotated[float, Signal("rad", "angle demand 2", 3.0)]
    i_1_set: Annotated[float, Signal("A", "current demand 1", 5.0)]
    i_2_set: Annotated[float, Signal("A", "current demand 2", 5.0)]


class ScrewRig(Assembly[WedgeParameters, Memory]):
    """Model of the rig.

    It has two dry frictions, bearings and screw on each shaft. The sensor is bolted to both screws
    and also carries tension, so no contact opens.
    """

    name: ClassVar[str] = "screw-rig"
    Memory: ClassVar = Memory
    Stimulus: ClassVar = Stimulus
    frictions: ClassVar[tuple[str, ...]] = ("omega_1", "omega_2")

    W_electric = Integral("J", "electrical energy into the motors")
    drive_1 = Part(current_drive, par="drive", suffix="_1")
    motor_1 = Part(servo_motor, suffix="_1", fixed=("theta",), loss=LOSSES)
    drive_2 = Part(current_drive, par="drive", suffix="_2")
    motor_2 = Part(servo_motor, suffix="_2", fixed=("theta",), loss=LOSSES)
    E_shaft = Integral(
        "J", "friction of bearings and screws", role=Role("sink", "bearings and screws")
    )
    line = Part(force_sensor, par="rig.sensor", state={"y": "y_F"}, loss="E_line")
    t_stuck = Integral("s", "time during which both shafts stick", role=Role("standstill"))
    F = Wire("N", "force on the sensor", 1000.0)
    q_1 = Shown("rad", "angle from encoder 1", 3.0)
    q_2 = Shown("rad", "angle from encoder 2", 3.0)
    voltage_1 = Shown("V", "motor voltage 1", 10.0)
    voltage_2 = Shown("V", "motor voltage 2", 10.0)
    T_fr_1 = Shown("N*m", "friction torque 1", 0.1)
    T_fr_2 = Shown("N*m", "friction torque 2", 0.1)
    stuck = Shown("1", "both shafts stuck")
    P_el = Shown("W", "electrical power", 50.0)
    E_source = Shown("J", "electrical energy into the motors", role=Role("source", "source"))

    records: ClassVar[tuple[str, ...]] = (
        "theta_1_ref",
        "theta_2_ref",
        "theta_1",
        "theta_2",
        "q_1",
        "q_2",
        "omega_1",
        "omega_2",
        "i_1_ref",
        "i_2_ref",
        "i_1",
        "i_2",
        "voltage_1",
        "voltage_2",
        "F",
        "y_F",
        "T_fr_1",
        "T_fr_2",
        "stuck",
        "P_el",
        "E_source",
        "E_copper",
        "E_damping",
        "E_shaft",
        "E_line",
        "E_stored",
        "t_stuck",
    )

    def wire(self, w: Self) -> None:
        """Connect the line between the screws with both drives and motors."""
        k, left, right = roller_screw.slope(w.par.screw), w.motor_1.x, w.motor_2.x
        w.line.u = force_sensor.Input(
            k * left.theta,
            k * right.theta,
            k * left.omega,
            k * right.omega,
            screws_compliance(w.par),
        )
        w.F = force_sensor.force(w.line.u, w.line.par)
        drive_train.wire(w.drive_1, w.motor_1, w.m.i_1_ref, ON, -w.F, w.par)
        drive_train.wire(w.drive_2, w.motor_2, w.m.i_2_ref, ON, w.F, w.par)

    def friction(self, w: Self) -> tuple[Bounds, ...]:
        """Return the friction limits on both shafts."""
        return tuple(
            drive_train.bounds(motor.x.omega, drive_train.torque(motor), force, w.par)
            for motor, force in ((w.motor_1, -w.F), (w.motor_2, w.F))
        )

    def power(self, w: Self) -> dict[str, float]:
        """Return the input power and the friction power."""
        friction_1, friction_2 = w.reaction
        return {
            "W_electric": drive_train.power(w.motor_1) + drive_train.power(w.motor_2),
            "E_shaft": -(friction_1 * w.motor_1.x.omega + friction_2 * w.motor_2.x.omega),
            "t_stuck": _stuck(w),
        }

    def record(self, w: Self) -> dict[str, float]:
        """Return the recorded signals other than states, wires and losses."""
        return {
            "q_1": shaft_encoder.reading(w.motor_1.x.theta, w.par.encoder),
            "q_2": shaft_encoder.reading(w.motor_2.x.theta, w.par.encoder),
            "voltage_1": w.motor_1.u.v,
            "voltage_2": w.motor_2.u.v,
            "T_fr_1": -w.reaction[0],
            "T_fr_2": -w.reaction[1],
            "stuck": _stuck(w),
            "P_el": drive_train.power(w.motor_1) + drive_train.power(w.motor_2),
            "E_source": w.flow.W_electric,
        }

    def tasks(self, par: Par) -> tuple[Task, ...]:
        """Return the task of the real-time computer, which controls both motors."""
        return (Task("motors", par.control.T_fast, tick),)


def screws_compliance(par: Par) -> float:
    """Return the axial compliance of both screws together [m/N]."""
    return 2.0 / par.heart.K_S


def _stuck(w: ScrewRig) -> float:
    """Return 1 if both shafts are at rest, else 0."""
    moving = ops.fabs(w.motor_1.x.omega) + ops.fabs(w.motor_2.x.omega)
    return ops.where(moving == 0, 1.0, 0.0)


def tick(x: Any, m: Memory, u: Stimulus, par: Par) -> Memory:
    """Run the real-time computer once, for both motors."""
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
