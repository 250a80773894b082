"""One shaft of the wedge brake's drive train alone: known current, known axial force.

The drive, its current loop and the other shaft are left out: where current and force are measured,
nothing of them is needed. For identification.
"""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, NamedTuple, Self

from bywire.brakes.wedge import drive_train
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.brakes.wedge.rigs.rig_parameters import dummy_inertia
from bywire.core.assembly import Assembly
from bywire.core.model import Bounds, Task
from bywire.core.parts import Integral, Part
from bywire.core.signals import Role, Signal
from bywire.plant import driven_rotor, roller_screw, servo_motor

Par = WedgeParameters


class Load(NamedTuple):
    """What acts on the shaft, held from one sample to the next."""

    i: Annotated[float, Signal("A", "motor current", 5.0)]
    F: Annotated[float, Signal("N", "axial force on the screw", 1000.0)]


class DrivenShaft(Assembly[WedgeParameters, Load]):
    """Model of one shaft.

    One dry friction: bearings and screw together. ``rig.load`` says whether the dummy shaft's
    inertia is on it. Without cogging where ``motor_1.T_cog`` is zero.
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
        """Say what the shaft feels: the measured current and force."""
        load = roller_screw.load_torque(roller_screw.Input(w.m.F, 0.0), w.par.screw)
        w.rotor.u = driven_rotor.Input(i=w.m.i, load=load, friction=0.0)

    def mass(self, xe: Any, par: Par) -> Any:
        """Return the inertia, that of the dummy shaft included."""
        rotor = super().mass(xe, par)
        return rotor._replace(omega=rotor.omega + dummy_inertia(par.rig))

    def friction(self, w: Self) -> tuple[Bounds, ...]:
        """Return the limits of the friction on the shaft."""
        torque = servo_motor.torque_constant(w.rotor.par) * w.m.i
        return (drive_train.bounds(w.rotor.x.omega, torque, w.m.F, w.par),)

    def power(self, w: Self) -> dict[str, float]:
        """Return the power of the friction."""
        return {"E_shaft": -w.reaction[0] * w.rotor.x.omega}

    def tasks(self, par: Par) -> tuple[Task, ...]:
        """Return the hold of the measured current and force."""
        return (Task("hold", par.control.T_fast, hold),)


def hold(x: Any, m: Load, u: Load, par: Par) -> Load:
    """Take over what is measured."""
    return u
