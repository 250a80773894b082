"""The two-wheeler with the complete by-wire brake of Dardanelli et al. (2010) at its rear wheel.

The model of the front brake is only its pressure loop. The rear brake is complete: battery, motor,
screw, cylinder, line, caliper, and an ECU with dither. Its ECU follows the rider's demand after
slip control.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar, Self

from bywire.brakes.motorcycle.model import MotorcycleBrake
from bywire.brakes.motorcycle.trim import memory_at, resting_at
from bywire.brakes.two_wheeler import ecu
from bywire.brakes.two_wheeler.model import TwoWheelerByWire, awake, tick
from bywire.brakes.two_wheeler.parameters import WholeRearParameters
from bywire.core.model import Task
from bywire.core.parts import Part, Sub, Wire
from bywire.plant import brake_disc, pressure_loop, wheel_encoder
from bywire.vehicle.two_wheeler import HotBrakes, cold_start, rolling_start

Par = WholeRearParameters


class TwoWheelerWholeRear(HotBrakes[WholeRearParameters, Any]):
    """A vehicle whose ECU reduces the demand on the rear brake's ECU.

    The pad force comes from the caliper, so a sticking caliper drags.
    """

    name: ClassVar[str] = "two-wheeler-whole-rear"
    Memory: ClassVar = ecu.Memory
    Stimulus: ClassVar = ecu.Stimulus

    front_circuit = Part(pressure_loop, par="front.circuit", suffix="_f", which="front")
    front_encoder = Part(wheel_encoder, par="sensors.encoder", suffix="_f", which="front")
    rear_encoder = Part(wheel_encoder, par="sensors.encoder", suffix="_r", which="rear")
    front_disc = Part(brake_disc, par="front.disc")
    rear_disc = Part(brake_disc, par="rear.disc")
    actuator = Sub(
        MotorcycleBrake,
        prefix="rear_",
        par="rear.actuator",
        label="rear brake",
        feeds={"p_set": "p_r_ref"},
    )
    p_r = Wire("Pa", "pressure at the rear pads", 2e6)

    records: ClassVar[tuple[str, ...]] = (*TwoWheelerByWire.records, *actuator.records)

    def cold_torques(self, w: Self) -> tuple[float, float]:
        """Return the torques that cold discs can hold at the pad pressures."""
        w.p_r = w.actuator.pads.x.p
        w.front_circuit.u = pressure_loop.Input(w.m.p_f_ref)
        w.front_encoder.u = wheel_encoder.Input(w.front.x.omega)
        w.rear_encoder.u = wheel_encoder.Input(w.rear.x.omega)
        w.front_disc.u = brake_disc.Input(w.front_circuit.x.p)
        w.rear_disc.u = brake_disc.Input(w.p_r)
        return (
            brake_disc.output(w.front_disc.u, w.front_disc.par).torque,
            brake_disc.output(w.rear_disc.u, w.rear_disc.par).torque,
        )

    def tasks(self, par: Par) -> tuple[Task, ...]:
        """Return the vehicle's task, and then the brake's task, which follows in the same tick."""
        return (Task("ecu", par.ecu.T_s, tick), *super().tasks(par))

    def rest(self, par: Par) -> tuple[Any, Any]:
        """Return the vehicle at rest on its wheels, with open brakes."""
        return at_speed(0.0, par)


def at_speed(
    v: float, par: Par, heat: Mapping[str, Any] | None = None, p_rear: float = 0.0
) -> tuple[Any, Any]:
    """Return the vehicle rolling at a speed [m/s], with an open front brake and running ECUs.

    Parameters
    ----------
    heat
        Brake temperatures by part. Default: `cold_start`.
    p_rear
        Pressure [Pa] that the vehicle's ECU demands and the rear brake's ECU holds.
    """
    warm = cold_start(par.front.heat, par.rear.heat) if heat is None else heat
    vehicle, brake = rolling_start(v, par.vehicle), par.rear.actuator
    memory = awake(v, par.vehicle, par.ecu.T_s)._replace(p_r_ref=p_rear, p_r_most=p_rear)
    return (
        TwoWheelerWholeRear.state(**vehicle, **warm, actuator=resting_at(p_rear, brake)),
        TwoWheelerWholeRear.memory(memory, actuator=memory_at(p_rear, brake)),
    )
