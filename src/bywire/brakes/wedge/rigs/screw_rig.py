"""Rig of two motors that drive their screws against each other, with a force sensor between.

Source: R. Roberts, M. Schautt, H. Hartmann, B. Gombert, "Modelling and Validation of the
Mechatronic Wedge Brake", SAE, 2003, sections "Roller-screw efficiency", "Drive train stiffnesses",
"Force fight tests".
"""

from __future__ import annotations

from typing import ClassVar

from bywire.brakes.wedge import drive_train
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.brakes.wedge.rigs import screw_rig_output as recording
from bywire.brakes.wedge.rigs import screw_rig_plant as plant
from bywire.core.model import Bounds, Matrix, Model, Task
from bywire.plant import force_sensor

Par = WedgeParameters


class ScrewRig(Model):
    """Model of the rig for the engine; see ``bywire.core.model.Model``.

    Two dry frictions: bearings and screw on each shaft. The sensor is bolted to both screws, so
    that it takes tension as well: no contact opens.
    """

    name: ClassVar[str] = "screw-rig"
    State: ClassVar = plant.State
    Memory: ClassVar = plant.Memory
    Stimulus: ClassVar = plant.Stimulus
    Flow: ClassVar = plant.Flow
    Output: ClassVar = recording.Output
    frictions: ClassVar[tuple[str, ...]] = ("omega_1", "omega_2")
    limits: ClassVar[tuple[str, ...]] = ()
    usually_open: ClassVar[tuple[bool, ...]] = ()

    def tasks(self, par: Par) -> tuple[Task, ...]:
        """Return the one real-time computer, which serves both motors."""
        return (Task("motors", par.control.T_fast, plant.tick),)

    def mass(self, xe: plant.State, par: Par) -> plant.State:
        """Return inductances and inertias."""
        both = (drive_train.mass(motor) for motor in (par.motor_1, par.motor_2))
        return plant.State._make((*(row for rows in both for row in rows), 1.0))

    def balance(
        self, x: plant.State, xe: plant.State, m: plant.Memory, par: Par, contact: tuple[float, ...]
    ) -> plant.State:
        """Return voltages, torques, and the filters' rates."""
        rows: list[float] = []
        for s, force in zip(plant.sides(x, xe, m, par), plant.forces(x, par), strict=True):
            rows += drive_train.balance(s, plant.ON, force, par)
        sensor = force_sensor.State(x.y_F)
        shown = force_sensor.rate(sensor, plant.line(x, par), par.rig.sensor)
        return plant.State._make((*rows, *shown))

    def bounds(
        self, x: plant.State, xe: plant.State, m: plant.Memory, par: Par, contact: tuple[float, ...]
    ) -> tuple[Bounds, ...]:
        """Return the limits of the frictions on both shafts."""
        both = zip(plant.sides(x, xe, m, par), plant.forces(x, par), strict=True)
        return tuple(drive_train.bounds(s, force, par) for s, force in both)

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
        return plant.rates(x, m, par, reaction)

    def output(
        self,
        x: plant.State,
        m: plant.Memory,
        par: Par,
        contact: tuple[float, ...],
        reaction: tuple[float, ...],
        flow: plant.Flow,
    ) -> recording.Output:
        """Return what is recorded at an instant."""
        return recording.instant(x, m, par, reaction, flow)
