"""The wedge brake: two motors, screws, brake heart, wedge, caliper, disc, and its controllers.

Source: R. Roberts, M. Schautt, H. Hartmann, B. Gombert, "Modelling and Validation of the
Mechatronic Wedge Brake", SAE, 2003.
"""

from __future__ import annotations

from typing import Any, ClassVar

from bywire.brakes.wedge import control, drive_train, energy, plant
from bywire.brakes.wedge import output as recording
from bywire.brakes.wedge import watch as warnings
from bywire.brakes.wedge.elements import brake_heart, wedge, wedge_caliper
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.core.model import Bounds, Matrix, Model, Task
from bywire.plant import drive_supply, end_stop, flywheel, moment_sensor, shaft_encoder

Par = WedgeParameters


class WedgeBrake(Model):
    """Model of the brake for the engine; see ``bywire.core.model.Model``.

    Four dry frictions: both shafts (bearings and screw), the wedge, the pads on the disc. Six
    contacts: three coupled ones in the heart, the caliper, two end stops of the wedge.
    """

    name: ClassVar[str] = "wedge-brake"
    State: ClassVar = plant.State
    Memory: ClassVar = control.Memory
    Stimulus: ClassVar = control.Stimulus
    Flow: ClassVar = energy.Flow
    Output: ClassVar = recording.Output
    frictions: ClassVar[tuple[str, ...]] = ("omega_1", "omega_2", "v", "Omega")
    limits: ClassVar[tuple[str, ...]] = ()
    usually_open: ClassVar[tuple[bool, ...]] = (False, False, True, True)

    def tasks(self, par: Par) -> tuple[Task, ...]:
        """Return the controllers, the outer one first."""
        T = par.control
        if par.command.mode == "current":
            return (Task("current", T.T_fast, self._current),)
        position = Task("position", T.T_fast, self._position)
        if par.command.mode == "position":
            return (position,)
        return (Task("moment", T.T_slow, self._moment), position)

    def _moment(
        self, x: plant.State, m: control.Memory, u: control.Stimulus, par: Par
    ) -> control.Memory:
        return control.moment_tick(_readings(x, par), m, u, par)

    def _position(
        self, x: plant.State, m: control.Memory, u: control.Stimulus, par: Par
    ) -> control.Memory:
        return control.position_tick(_readings(x, par), m, u, par)

    def _current(
        self, x: plant.State, m: control.Memory, u: control.Stimulus, par: Par
    ) -> control.Memory:
        return control.current_tick(m, u)

    def mass(self, xe: plant.State, par: Par) -> plant.State:
        """Return inductances, inertias and masses."""
        rows: list[float] = []
        for motor in (par.motor_1, par.motor_2):
            rows += drive_train.mass(motor)
        body, disc = wedge.mass(par.wedge), flywheel.mass(par.flywheel)
        return plant.State._make((*rows, *body, *disc, 1.0, 1.0))

    def balance(
        self,
        x: plant.State,
        xe: plant.State,
        m: control.Memory,
        par: Par,
        contact: tuple[float, ...],
    ) -> plant.State:
        """Return voltages, torques, forces, and the filters' rates."""
        w = plant.wires(xe, par, contact)
        rows: list[float] = []
        for s, force in zip(plant.sides(x, xe, m, par), (w.F_1, w.F_2), strict=True):
            rows += drive_train.balance(s, m.on, force, par)
        body = wedge.balance(wedge.State(x.x, x.v), plant.wedge_input(w, 0.0), par.wedge)
        disc = flywheel.balance(flywheel.State(x.Omega, x.phi), flywheel.Input(0.0), par.flywheel)
        # Value-only: the brake does not feel the measurement of its power.
        power = drive_supply.Input(plant.motor_power(xe, m, par))
        sensor = moment_sensor.State(x.y_M)
        moment = moment_sensor.rate(sensor, moment_sensor.Input(w.M_B), par.moment_sensor)
        shown = drive_supply.rate(drive_supply.State(x.y_P), power, par.supply)
        return plant.State._make((*rows, *body, *disc, *moment, *shown))

    def bounds(
        self,
        x: plant.State,
        xe: plant.State,
        m: control.Memory,
        par: Par,
        contact: tuple[float, ...],
    ) -> tuple[Bounds, ...]:
        """Return the limits of the frictions on both shafts, on the wedge and on the disc."""
        w = plant.wires(xe, par, contact)
        found: list[Bounds] = []
        for s, force in zip(plant.sides(x, xe, m, par), (w.F_1, w.F_2), strict=True):
            found.append(drive_train.bounds(s, force, par))
        sliding = plant.wedge_bound(w, par)
        moment = wedge_caliper.moment(w.F_N, par.wedge.mu_B, 1.0, par.caliper)
        return (*found, (-sliding, sliding), (-moment, moment))

    def compliance(self, par: Par) -> tuple[Matrix, ...]:
        """Return the compliances: coupled ones of the heart, the caliper, the end stops."""
        stop = end_stop.compliance(par.stop)
        caliper = wedge_caliper.compliance(par.caliper)
        return (brake_heart.matrix(par.heart), ((caliper,),), ((stop,),), ((stop,),))

    def gap(self, x: plant.State, xe: plant.State, par: Par) -> tuple[tuple[float, ...], ...]:
        """Return the damped overlaps of all contacts."""
        heart = brake_heart.overlaps(plant.heart_input(x, par), par.heart)
        caliper = wedge_caliper.overlap(plant.caliper_input(x, xe, par), par.caliper)
        stop = end_stop.overlaps(plant.stop_input(x, par), par.stop)
        return (tuple(heart), (caliper,), (stop.near,), (stop.far,))

    def powers(
        self,
        x: plant.State,
        xe: plant.State,
        rate: plant.State,
        m: control.Memory,
        par: Par,
        contact: tuple[float, ...],
        reaction: tuple[float, ...],
    ) -> energy.Flow:
        """Return the powers for the energy balance."""
        return energy.rates(x, xe, m, par, contact, reaction)

    def output(
        self,
        x: plant.State,
        m: control.Memory,
        par: Par,
        contact: tuple[float, ...],
        reaction: tuple[float, ...],
        flow: energy.Flow,
    ) -> recording.Output:
        """Return what is recorded at an instant."""
        return recording.instant(x, m, par, contact, reaction, flow)

    def watch(self, recording: Any, par: Any) -> list[str]:
        """Return what the user should know of a recording."""
        return warnings.watch(recording, par)


def _readings(x: plant.State, par: Par) -> control.Readings:
    return control.Readings(
        theta_1=shaft_encoder.reading(x.theta_1, par.encoder),
        theta_2=shaft_encoder.reading(x.theta_2, par.encoder),
        M=x.y_M,
        Omega=x.Omega,
    )
