"""The motorcycle brake: DC motor, ball screw, master cylinder, pipeline, caliper, and its ECU.

Source: A. Dardanelli, G. Alli, S. M. Savaresi, "Modeling and control of an electro-mechanical
brake-by-wire actuator for a sport motorbike", 5th IFAC Symposium on Mechatronic Systems, 2010.
"""

from __future__ import annotations

from typing import Any, ClassVar

from bywire.brakes.motorcycle import ecu, energy, plant
from bywire.brakes.motorcycle import output as recording
from bywire.brakes.motorcycle import watch as warnings
from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.core.model import Bounds, Matrix, Model, Task
from bywire.plant import (
    anti_alias_filter,
    ball_screw_gear,
    caliper,
    current_sensor,
    dc_motor,
    end_stop,
    master_cylinder,
    pressure_sensor,
    seal_friction,
)

Par = MotorcycleParameters


class MotorcycleBrake(Model):
    """Model of the brake for the engine; see ``bywire.core.model.Model``.

    One dry friction (seals, and the gear when ``directional``) on the shaft; the chamber's
    pressure is one-sided because the reservoir makes up what is missing; two end stops.
    """

    name: ClassVar[str] = "motorcycle-brake"
    State: ClassVar = plant.State
    Memory: ClassVar = ecu.Memory
    Stimulus: ClassVar = ecu.Stimulus
    Flow: ClassVar = energy.Flow
    Output: ClassVar = recording.Output
    frictions: ClassVar[tuple[str, ...]] = ("omega",)
    limits: ClassVar[tuple[str, ...]] = ("p_mc",)
    usually_open: ClassVar[tuple[bool, ...]] = (True, True)

    def tasks(self, par: Par) -> tuple[Task, ...]:
        """Return the ECU's task, or that of an ideal source."""
        if par.drive.mode in ("voltage-source", "current-source"):
            return (Task("source", par.drive.T_source, self._source),)
        return (Task("ecu", par.ecu.T_s, self._ecu),)

    def _ecu(self, x: plant.State, m: ecu.Memory, u: ecu.Stimulus, par: Par) -> ecu.Memory:
        return ecu.tick(ecu.Readings(p=x.y_p, i=x.y_i), m, u, par)

    def _source(self, x: plant.State, m: ecu.Memory, u: ecu.Stimulus, par: Par) -> ecu.Memory:
        return ecu.source_tick(ecu.Readings(p=x.y_p, i=x.y_i), m, u, par)

    def mass(self, xe: plant.State, par: Par) -> plant.State:
        """Return inductance, inertia and fluid compliances."""
        cylinder = plant.cylinder_input(xe, 0.0, par)
        return plant.State(
            i=dc_motor.mass(dc_motor.State(xe.i), par.motor).i,
            theta=1.0,
            omega=ball_screw_gear.inertia(par.gear),
            p_mc=master_cylinder.mass(
                master_cylinder.State(xe.p_mc), cylinder, par.master_cylinder, par.fluid
            ),
            p_pd=caliper.mass(caliper.State(xe.p_pd), par.caliper, par.fluid),
            y_p=1.0,
            y_i=1.0,
        )

    def balance(
        self, x: plant.State, xe: plant.State, m: ecu.Memory, par: Par, contact: tuple[float, ...]
    ) -> plant.State:
        """Return voltage, torque and flow balances, and the filters' rates."""
        w = plant.wires(x, m, par, contact)
        motor = dc_motor.balance(dc_motor.State(x.i), dc_motor.Input(w.voltage, x.omega), par.motor)
        shaft = ball_screw_gear.balance(
            ball_screw_gear.State(x.theta, x.omega),
            ball_screw_gear.Input(torque=w.torque, force=w.force, friction=0.0),
            par.gear,
        )
        leak = plant.port_conductance(xe, par) * x.p_mc
        driven = par.drive.mode != "current-source"
        return plant.State(
            i=motor.i if driven else 0.0 * x.i,
            theta=shaft.theta,
            omega=shaft.omega,
            p_mc=master_cylinder.balance(
                plant.cylinder_input(x, w.q + leak, par), par.master_cylinder
            ),
            p_pd=w.q,
            y_p=anti_alias_filter.rate(x.y_p, _pressure_reading(xe, par), par.anti_alias),
            y_i=anti_alias_filter.rate(
                x.y_i,
                current_sensor.reading(_sensed(xe, m, par), par.current_sensor),
                par.anti_alias,
            ),
        )

    def bounds(
        self, x: plant.State, xe: plant.State, m: ecu.Memory, par: Par, contact: tuple[float, ...]
    ) -> tuple[Bounds, ...]:
        """Return the limits of the dry friction torque on the shaft."""
        seal = seal_friction.output(seal_friction.Input(x.omega, x.p_mc), par.seal)
        load = plant.wires(x, m, par, contact).force
        low, high = ball_screw_gear.friction_bounds(seal.T_p, seal.T_n, load, par.gear)
        return ((low, high),)

    def compliance(self, par: Par) -> tuple[Matrix, ...]:
        """Return the compliances of the two end stops, which do not touch each other."""
        c = end_stop.compliance(par.stop)
        return (((c,),), ((c,),))

    def gap(self, x: plant.State, xe: plant.State, par: Par) -> tuple[tuple[float, ...], ...]:
        """Return the damped overlaps at the two end stops."""
        d = end_stop.overlaps(plant.stop_input(x, par), par.stop)
        return ((d.near,), (d.far,))

    def powers(
        self,
        x: plant.State,
        xe: plant.State,
        rate: plant.State,
        m: ecu.Memory,
        par: Par,
        contact: tuple[float, ...],
        reaction: tuple[float, ...],
    ) -> energy.Flow:
        """Return the powers for the energy balance."""
        return energy.rates(x, rate, m, par, contact, reaction)

    def output(
        self,
        x: plant.State,
        m: ecu.Memory,
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


def _pressure_reading(xe: plant.State, par: Par) -> float:
    """Return the pressure sensor's reading, value-only: the brake does not feel its sensor."""
    middle = par.pressure_sensor.place == "mid-pipeline"
    gauge = 0.5 * (xe.p_mc + xe.p_pd) if middle else xe.p_mc
    return pressure_sensor.reading(gauge + par.fluid.p_atm, par.pressure_sensor)


def _sensed(xe: plant.State, m: ecu.Memory, par: Par) -> float:
    return m.i_source if par.drive.mode == "current-source" else xe.i
