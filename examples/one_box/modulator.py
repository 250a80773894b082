"""Outlet valve, accumulator and return pump, which lower the pressure of one wheel."""

from __future__ import annotations

from typing import Any, ClassVar, TypeVar

from bywire.authoring import Bounds, Integral, Part, Wire
from bywire.core import ops
from bywire.plant import (
    accumulator,
    battery_supply,
    dc_motor,
    return_pump,
    shaft,
    solenoid_valve,
)
from one_box.hydraulics import Hydraulics, released_parts
from one_box.parameters import OneBoxParameters

_LEFT = 3e-3  # share of the accumulator that is filled at the start, beside its kink
_FULL = 1e-3  # share of the displacement by which the pump is filled beside its kink


class ModulatorParameters(OneBoxParameters):
    """The brake with the valves of one wheel."""

    outlet: solenoid_valve.Parameters
    accumulator: accumulator.Parameters
    pump: return_pump.Parameters
    pump_motor: dc_motor.Parameters
    pump_shaft: shaft.Parameters


ParT = TypeVar("ParT", bound=ModulatorParameters)
MemoryT = TypeVar("MemoryT")


class Modulator(Hydraulics[ParT, MemoryT]):
    """The brake whose wheel pressure can be lowered. The pump returns the fluid to the circuit.

    The set-valued load of the pump is a second dry friction.
    """

    frictions: ClassVar[tuple[str, ...]] = ("omega", "omega_p")
    outlet = Part(solenoid_valve, suffix="_out", which="outlet valve", loss="E_outlet")
    store = Part(accumulator, par="accumulator", state={"V": "V_acc"})
    pump = Part(return_pump, state={"V": "V_pump"}, loss="E_pump")
    pump_motor = Part(dc_motor, suffix="_p", which="pump motor", loss="E_copper_p")
    pump_shaft = Part(shaft, suffix="_p", which="pump", loss="E_viscous_p")
    V_released = Integral("m**3", "volume released into the accumulator")
    V_pumped = Integral("m**3", "volume returned by the pump")

    p_acc = Wire("Pa", "accumulator pressure", 2e5)
    q_suck = Wire("m**3/s", "flow into the return pump", 3e-6)
    T_pump = Wire("N*m", "mean load of the return pump", 0.1)
    T_held = Wire("N*m", "torque that the resting return pump holds", 0.1)

    def wire(self, w: Any) -> None:
        """Connect the valves, accumulator and pump, then the rest of the brake."""
        fluid, p = w.par.fluid, w.others.x.p
        w.closed = w.m.close_on
        w.p_acc = accumulator.pressure(w.store.x, w.store.par, fluid)
        w.outlet.u = solenoid_valve.Input(w.m.release_on, w.caliper.x.p, w.p_acc)
        w.q_out = solenoid_valve.flow(w.outlet.x, w.outlet.u, w.outlet.par, fluid)
        turning = w.pump_shaft.x
        w.pump.u = return_pump.Input(turning.theta, turning.omega, w.p_acc, p)
        pumped = return_pump.output(w.pump.x, w.pump.u, w.pump.par, fluid)
        w.q_suck, w.q_pump = pumped.q_s, pumped.q_d
        w.T_pump, w.T_held = pumped.torque, pumped.friction
        w.store.u = accumulator.Input(w.q_out - w.q_suck)
        w.i_pump = w.m.pump * w.pump_motor.x.i  # the relay shorts the motor when it is off
        super().wire(w)
        bus = battery_supply.output(w.supply.u, w.supply.par).v_bus
        w.pump_motor.u = dc_motor.Input(w.m.pump * bus, turning.omega)
        driven = dc_motor.output(w.pump_motor.x, w.pump_motor.par).torque
        w.pump_shaft.u = shaft.Input(driven - w.T_pump, 0.0)

    def friction(self, w: Any) -> tuple[Bounds, ...]:
        """Return the bounds of the friction on the motor shaft and of the pump's load."""
        return (*super().friction(w), (-w.T_held, w.T_held))

    def power(self, w: Any) -> dict[str, float]:
        """Return the powers and flows that do not follow from the parts."""
        omega = w.pump_shaft.x.omega
        load = -w.reaction[1] * omega - w.T_held * ops.fabs(omega)  # beyond that of the element
        return {
            **super().power(w),
            "E_pump": w.pump.call(return_pump.power_loss) + load,
            "V_released": w.q_out,
            "V_pumped": w.q_pump,
        }

    def held_volume(self, w: Any) -> float:
        """Return the volume in brakes, accumulator and pump, minus that at the start [m^3]."""
        start = modulator_parts(w.par)
        held: float = w.store.x.V - start["store"].V + w.pump.x.V - start["pump"].V
        return super().held_volume(w) + held


def modulator_parts(par: ModulatorParameters) -> dict[str, Any]:
    """Return the states of the parts of a released brake, with a filled pump."""
    pump = par.pump
    full = return_pump.area(pump) * pump.e * ops.cos(pump.phase)
    full = full + _FULL * return_pump.displacement(pump)
    return {
        **released_parts(par),
        "outlet": solenoid_valve.State(solenoid_valve.lift(0.0, par.outlet)),
        "store": accumulator.State(_LEFT * par.accumulator.V_max),
        "pump": return_pump.State(full),
    }
