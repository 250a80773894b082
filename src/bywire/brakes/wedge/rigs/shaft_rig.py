"""Rig of a single motor: on a dummy shaft or a preloaded screw, its shaft free or clamped.

Source: R. Roberts, M. Schautt, H. Hartmann, B. Gombert, "Modelling and Validation of the
Mechatronic Wedge Brake", SAE, 2003, sections "Motor & rollerscrew alone", "Motor current loop".
"""

from __future__ import annotations

from typing import ClassVar

from bywire.brakes.wedge import drive_train
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.brakes.wedge.rigs import shaft_rig_plant as plant
from bywire.core.model import Bounds, Matrix, Model, Task

Par = WedgeParameters


class ShaftRig(Model):
    """Model of the rig for the engine; see ``bywire.core.model.Model``.

    One dry friction: bearings, screw and clamp together.
    """

    name: ClassVar[str] = "shaft-rig"
    State: ClassVar = plant.State
    Memory: ClassVar = plant.Memory
    Stimulus: ClassVar = plant.Stimulus
    Flow: ClassVar = plant.Flow
    Output: ClassVar = plant.Output
    frictions: ClassVar[tuple[str, ...]] = ("omega_1",)
    limits: ClassVar[tuple[str, ...]] = ()
    usually_open: ClassVar[tuple[bool, ...]] = ()

    def tasks(self, par: Par) -> tuple[Task, ...]:
        """Return the one controller."""
        return (Task(par.rig.mode_1, par.control.T_fast, plant.tick),)

    def mass(self, xe: plant.State, par: Par) -> plant.State:
        """Return the inductance and the inertia, that of the dummy shaft included."""
        motor = plant.State._make(drive_train.mass(par.motor_1))
        return motor._replace(omega_1=motor.omega_1 + plant.dummy(par))

    def balance(
        self,
        x: plant.State,
        xe: plant.State,
        m: plant.Memory,
        par: Par,
        contact: tuple[float, ...],
    ) -> plant.State:
        """Return voltage, torque, and the filters' rates."""
        s = plant.side(x, xe, m, par)
        return plant.State._make(drive_train.balance(s, plant.ON, plant.NUT, par))

    def bounds(
        self,
        x: plant.State,
        xe: plant.State,
        m: plant.Memory,
        par: Par,
        contact: tuple[float, ...],
    ) -> tuple[Bounds, ...]:
        """Return the limits of the friction on the shaft."""
        return (plant.friction(plant.side(x, xe, m, par), par),)

    def compliance(self, par: Par) -> tuple[Matrix, ...]:
        """Return none: the rig has no contacts."""
        return ()

    def gap(self, x: plant.State, xe: plant.State, par: Par) -> tuple[tuple[float, ...], ...]:
        """Return none: the rig has no contacts."""
        return ()

    def powers(
        self,
        x: plant.State,
        xe: plant.State,
        rate: plant.State,
        m: plant.Memory,
        par: Par,
        contact: tuple[float, ...],
        reaction: tuple[float, ...],
    ) -> plant.Flow:
        """Return the powers for the energy balance."""
        return plant.rates(x, m, par, reaction[0])

    def output(
        self,
        x: plant.State,
        m: plant.Memory,
        par: Par,
        contact: tuple[float, ...],
        reaction: tuple[float, ...],
        flow: plant.Flow,
    ) -> plant.Output:
        """Return what is recorded at an instant."""
        return plant.instant(x, m, par, reaction[0], flow)
