"""The two-wheeler with a pressure loop for each brake."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar, Self

from bywire.brakes.two_wheeler import ecu
from bywire.brakes.two_wheeler.parameters import TwoWheelerParameters
from bywire.core.model import Task
from bywire.core.parts import Part
from bywire.core.signals import zeros
from bywire.plant import brake_disc, pressure_loop, road, road_wheel, wheel_encoder
from bywire.vehicle.slip_control import far_from_peak
from bywire.vehicle.two_wheeler import HotBrakes, VehicleParameters, cold_start, rolling_start

Par = TwoWheelerParameters


class TwoWheelerByWire(HotBrakes[TwoWheelerParameters, ecu.Memory]):
    """A vehicle with brakes that follow their demands like second-order loops."""

    name: ClassVar[str] = "two-wheeler-by-wire"
    Memory: ClassVar = ecu.Memory
    Stimulus: ClassVar = ecu.Stimulus

    front_circuit = Part(pressure_loop, par="front.circuit", suffix="_f", which="front")
    rear_circuit = Part(pressure_loop, par="rear.circuit", suffix="_r", which="rear")
    front_encoder = Part(wheel_encoder, par="sensors.encoder", suffix="_f", which="front")
    rear_encoder = Part(wheel_encoder, par="sensors.encoder", suffix="_r", which="rear")
    front_disc = Part(brake_disc, par="front.disc")
    rear_disc = Part(brake_disc, par="rear.disc")

    records: ClassVar[tuple[str, ...]] = (
        "x",
        "v",
        "v_f",
        "v_r",
        "a",
        "omega_f",
        "omega_r",
        "slip_f",
        "slip_r",
        "mu_f",
        "mu_r",
        "sliding_f",
        "sliding_r",
        "u_f",
        "u_r",
        "F_f",
        "F_r",
        "N_f",
        "N_r",
        "support",
        "phi",
        "phi_rate",
        "p_f",
        "p_r",
        "p_f_ref",
        "p_r_ref",
        "v_hat",
        "slip_f_hat",
        "slip_r_hat",
        "a_hat",
        "eta_f",
        "abs_f",
        "abs_r",
        "lift",
        "phase_f",
        "phase_r",
        "T_f",
        "T_r",
        "t_locked_f",
        "t_locked_r",
        "E_vehicle",
        "E_brake_f",
        "E_brake_r",
        "E_tyre_f",
        "E_tyre_r",
        "E_drag",
        "E_roll",
        "E_ground",
        "W_slope",
        "W_pitch",
        "T_disc_f",
        "T_pads_f",
        "T_fluid_f",
        "T_disc_r",
        "T_pads_r",
        "T_fluid_r",
        "E_friction",
        "E_discs",
        "E_pads",
        "E_fluid",
        "E_air",
    )

    def cold_torques(self, w: Self) -> tuple[float, float]:
        """Return the torques that cold discs can hold at the circuit pressures."""
        w.front_circuit.u = pressure_loop.Input(w.m.p_f_ref)
        w.rear_circuit.u = pressure_loop.Input(w.m.p_r_ref)
        w.front_encoder.u = wheel_encoder.Input(w.front.x.omega)
        w.rear_encoder.u = wheel_encoder.Input(w.rear.x.omega)
        w.front_disc.u = brake_disc.Input(w.front_circuit.x.p)
        w.rear_disc.u = brake_disc.Input(w.rear_circuit.x.p)
        return (
            brake_disc.output(w.front_disc.u, w.front_disc.par).torque,
            brake_disc.output(w.rear_disc.u, w.rear_disc.par).torque,
        )

    def tasks(self, par: Par) -> tuple[Task, ...]:
        """Return the ECU's task."""
        return (Task("ecu", par.ecu.T_s, tick),)

    def remarks(self, recording: Any, par: Par) -> list[str]:
        """Return remarks on a slip far below the slip at maximum adhesion."""
        if par.ecu.abs != "pi" or par.ecu.mix.alpha < 1.0:
            return []
        ways, x = par.vehicle.road, recording["x"].values
        front, rear = par.ecu.front_slip.slip_set, par.ecu.rear_slip.slip_set
        return [
            *far_from_peak(
                x,
                recording["abs_f"].values,
                front,
                "ecu.front_slip.slip_set",
                par.vehicle.front_tyre,
                ways,
            ),
            *far_from_peak(
                x - par.vehicle.body.L,
                recording["abs_r"].values,
                rear,
                "ecu.rear_slip.slip_set",
                par.vehicle.rear_tyre,
                ways,
            ),
        ]

    def rest(self, par: Par) -> tuple[Any, ecu.Memory]:
        """Return the vehicle at rest on its wheels, with released brakes."""
        return at_speed(0.0, par)


def at_speed(v: float, par: Par, heat: Mapping[str, Any] | None = None) -> tuple[Any, ecu.Memory]:
    """Return the vehicle rolling at a speed [m/s], with open brakes and a running ECU.

    ``heat``: brake temperatures by part; default: `cold_start`.
    """
    brakes = cold_start(par.front.heat, par.rear.heat) if heat is None else heat
    state = TwoWheelerByWire.state(**rolling_start(v, par.vehicle), **brakes)
    return state, awake(v, par.vehicle, par.ecu.T_s)


def awake(v: float, vehicle: VehicleParameters, T_s: float) -> ecu.Memory:
    """Return the memory of a running ECU with a sample time [s] at a vehicle speed [m/s]."""
    front, rear = v / vehicle.front_wheel.r, v / vehicle.rear_wheel.r
    return zeros(ecu.Memory)._replace(
        v_hat=v,
        v_last=v,
        tread_f=v,
        tread_r=v,
        omega_f_hat=front,
        omega_r_hat=rear,
        edge_f=-front * T_s,
        edge_r=-rear * T_s,
    )


def tick(x: Any, m: ecu.Memory, u: ecu.Stimulus, par: Par) -> ecu.Memory:
    """Run the ECU once, with its sensor readings."""
    front, rear = par.vehicle.front_wheel, par.vehicle.rear_wheel
    edges = [
        wheel_encoder.reading(
            wheel_encoder.State(theta), wheel_encoder.Input(omega), par.sensors.encoder
        )
        for theta, omega in ((x.theta_f, x.omega_f), (x.theta_r, x.omega_r))
    ]
    seen = ecu.Readings(
        v=x.v,
        sine=road.slope(x.x, par.vehicle.road).sine,
        tread_f=road_wheel.tread_speed(road_wheel.State(x.omega_f), front),
        tread_r=road_wheel.tread_speed(road_wheel.State(x.omega_r), rear),
        angle_f=edges[0].angle,
        angle_r=edges[1].angle,
        age_f=edges[0].age,
        age_r=edges[1].age,
    )
    return ecu.tick(seen, m, u, par)
