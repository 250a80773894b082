"""One shaft of the wedge brake's drive train alone: known current, known axial force.

The drive, its current loop and the other shaft are left out: where current and force are measured,
nothing of them is needed. For identification.
"""

from __future__ import annotations

from typing import Annotated, ClassVar, NamedTuple

from bywire.brakes.wedge import drive_train
from bywire.brakes.wedge.drive_train import Side
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.brakes.wedge.rigs import shaft_rig_plant
from bywire.core.model import Bounds, Model, Task
from bywire.core.signals import Signal, zeros
from bywire.plant import current_drive, roller_screw, servo_motor

Par = WedgeParameters


class Motion(NamedTuple):
    """Angle and speed of the shaft."""

    theta: Annotated[float, Signal("rad", "motor angle", 3.0)]
    omega: Annotated[float, Signal("rad/s", "motor speed", 50.0)]


class Load(NamedTuple):
    """What acts on the shaft, held from one sample to the next."""

    i: Annotated[float, Signal("A", "motor current", 5.0)]
    F: Annotated[float, Signal("N", "axial force on the screw", 1000.0)]


class Loss(NamedTuple):
    """Integrals over the run."""

    E_shaft: Annotated[float, Signal("J", "friction of bearings and screw")]


class DrivenShaft(Model):
    """Model of one shaft for the engine; see ``bywire.core.model.Model``.

    One dry friction: bearings and screw together. ``rig.load`` says whether the dummy shaft's
    inertia is on it. Without cogging where ``motor_1.T_cog`` is zero.
    """

    name: ClassVar[str] = "driven-shaft"
    State: ClassVar = Motion
    Memory: ClassVar = Load
    Stimulus: ClassVar = Load
    Flow: ClassVar = Loss
    Output: ClassVar = Motion
    frictions: ClassVar[tuple[str, ...]] = ("omega",)

    def tasks(self, par: Par) -> tuple[Task, ...]:
        """Return the hold of the measured current and force."""
        return (Task("hold", par.control.T_fast, hold),)

    def mass(self, xe: Motion, par: Par) -> Motion:
        """Return the inertia, that of the dummy shaft included."""
        return Motion(1.0, servo_motor.mass(par.motor_1).omega + shaft_rig_plant.dummy(par))

    def balance(
        self, x: Motion, xe: Motion, m: Load, par: Par, contact: tuple[float, ...]
    ) -> Motion:
        """Return speed and torque."""
        motor = servo_motor.State(m.i, xe.theta, x.omega)
        load = roller_screw.load_torque(roller_screw.Input(m.F, 0.0), par.screw)
        rows = servo_motor.balance(motor, servo_motor.Input(0.0, load, 0.0), par.motor_1)
        return Motion(rows.theta, rows.omega)

    def bounds(
        self, x: Motion, xe: Motion, m: Load, par: Par, contact: tuple[float, ...]
    ) -> tuple[Bounds, ...]:
        """Return the limits of the friction on the shaft."""
        motor = servo_motor.State(m.i, xe.theta, x.omega)
        s = Side(zeros(current_drive.State), motor, m.i, par.motor_1)
        return (drive_train.bounds(s, m.F, par),)

    def powers(
        self,
        x: Motion,
        xe: Motion,
        rate: Motion,
        m: Load,
        par: Par,
        contact: tuple[float, ...],
        reaction: tuple[float, ...],
    ) -> Loss:
        """Return the power of the friction."""
        return Loss(-reaction[0] * x.omega)

    def output(
        self,
        x: Motion,
        m: Load,
        par: Par,
        contact: tuple[float, ...],
        reaction: tuple[float, ...],
        flow: Loss,
    ) -> Motion:
        """Return angle and speed."""
        return x


def hold(x: Motion, m: Load, u: Load, par: Par) -> Load:
    """Take over what is measured."""
    return u
