"""The two-wheeler with two pressure loops for brakes."""

from __future__ import annotations

from typing import Any, ClassVar, Self

from bywire.brakes.two_wheeler import ecu
from bywire.brakes.two_wheeler.parameters import TwoWheelerParameters
from bywire.core.model import Task
from bywire.core.parts import Part
from bywire.core.signals import zeros
from bywire.plant import brake_disc, pressure_loop
from bywire.vehicle.two_wheeler import TwoWheeler, rolling_start

Par = TwoWheelerParameters


class TwoWheelerByWire(TwoWheeler[TwoWheelerParameters, ecu.Memory]):
    """Each brake follows its demand as a loop of second order, as fast as its bandwidth."""

    name: ClassVar[str] = "two-wheeler"
    Memory: ClassVar = ecu.Memory
    Stimulus: ClassVar = ecu.Stimulus

    front_circuit = Part(
        pressure_loop, par="front.circuit", suffix="_f", labels={"p": "front brake pressure"}
    )
    rear_circuit = Part(
        pressure_loop, par="rear.circuit", suffix="_r", labels={"p": "rear brake pressure"}
    )
    front_disc = Part(brake_disc, par="front.disc")
    rear_disc = Part(brake_disc, par="rear.disc")

    records: ClassVar[tuple[str, ...]] = (
        "x", "v", "a", "omega_f", "omega_r", "slip_f", "slip_r", "mu_f", "mu_r", "sliding_f",
        "sliding_r", "u_f", "u_r", "F_f", "F_r", "N_f", "N_r", "support", "phi", "phi_rate",
        "p_f", "p_r", "p_f_ref", "p_r_ref", "T_f", "T_r", "t_locked_f", "t_locked_r",
        "E_vehicle", "E_brake_f", "E_brake_r", "E_tyre_f", "E_tyre_r", "E_drag", "E_roll",
        "E_ground", "W_slope", "W_pitch",
    )  # fmt: skip

    def brake_torques(self, w: Self) -> tuple[float, float]:
        """Return what the discs hold at the pressures of both circuits."""
        w.front_circuit.u = pressure_loop.Input(w.m.p_f_ref)
        w.rear_circuit.u = pressure_loop.Input(w.m.p_r_ref)
        w.front_disc.u = brake_disc.Input(w.front_circuit.x.p)
        w.rear_disc.u = brake_disc.Input(w.rear_circuit.x.p)
        return (
            brake_disc.output(w.front_disc.u, w.front_disc.par).torque,
            brake_disc.output(w.rear_disc.u, w.rear_disc.par).torque,
        )

    def tasks(self, par: Par) -> tuple[Task, ...]:
        """Return the ECU's task."""
        return (Task("ecu", par.ecu.T_s, ecu.tick),)

    def rest(self, par: Par) -> tuple[Any, ecu.Memory]:
        """Return the vehicle standing on its wheels, brakes open."""
        return self.state(**rolling_start(0.0, par.vehicle)), zeros(ecu.Memory)
