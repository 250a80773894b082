"""The brake with DC motor, planetary gear, ball screw, floating caliper, and ECU."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ClassVar, Self

from bywire.authoring import Assembly, Bounds, Integral, Part, Role, Shown, Task, Wire
from bywire.core import ops
from bywire.plant import battery_supply, dc_motor, end_stop, h_bridge
from emb_caliper import ecu
from emb_caliper.elements import (
    ball_screw,
    floating_caliper,
    load_friction,
    planetary_gear,
    rotor,
)
from emb_caliper.parameters import CaliperBrakeParameters as Par


class EmbCaliper(Assembly[Par, ecu.Memory]):
    """Brake with one dry friction on the shaft, and contacts at the pads and two end stops."""

    name: ClassVar[str] = "emb-caliper"
    Memory: ClassVar = ecu.Memory
    Stimulus: ClassVar = ecu.Stimulus
    frictions: ClassVar[tuple[str, ...]] = ("omega",)

    E_source = Integral("J", "energy from battery or source", role=Role("source", "source"))
    supply = Part(battery_supply, loss="E_supply")
    motor = Part(dc_motor, loss="E_copper")
    rotor = Part(rotor, loss="E_viscous")
    dry = Part(load_friction, par="friction")
    E_friction = Integral("J", "dry friction loss", role=Role("sink", "dry friction"))
    gear = Part(planetary_gear)
    screw = Part(ball_screw, output=("x",))
    pads = Part(
        floating_caliper, par="caliper", output=("F_cl",), work="W_caliper", loss="E_caliper"
    )
    stop = Part(end_stop, work="W_stop", loss="E_stop", rarely=True)
    t_stuck = Integral("s", "time stuck", role=Role("standstill"))

    voltage = Wire("V", "motor voltage", 10.0)
    i_dc = Wire("A", "battery current", 10.0)
    torque = Wire("N*m", "motor torque", 1.0)
    T_fr = Shown("N*m", "friction torque", 0.1)
    F_stop = Shown("N", "end stop load on the piston", 1e3)
    stuck = Shown("1", "shaft stuck")
    P_el = Shown("W", "electrical power from battery or source", 100.0)

    records: ClassVar[tuple[str, ...]] = (
        "F_cl",
        "F_ref",
        "F_meas",
        "x",
        "theta",
        "omega",
        "omega_ref",
        "i",
        "i_ref",
        "duty",
        "voltage",
        "torque",
        "T_fr",
        "F_stop",
        "stuck",
        "parked",
        "sat_speed",
        "sat_current",
        "sat_duty",
        "P_el",
        "E_source",
        "E_supply",
        "E_copper",
        "E_viscous",
        "E_friction",
        "E_caliper",
        "E_stop",
        "E_stored",
        "t_stuck",
    )

    def wire(self, w: Self) -> None:
        """Connect the parts: electrics, motion from rotor to pads, loads from pads to rotor."""
        w.voltage, w.i_dc = _electrics(w)
        w.supply.u = battery_supply.Input(w.i_dc)
        w.motor.u = dc_motor.Input(w.voltage, w.rotor.x.omega)
        w.torque = dc_motor.output(w.motor.x, w.motor.par).torque
        piston = travel(w.rotor.x, w.par)
        w.pads.u = floating_caliper.Input(piston.x, piston.v)
        stop = w.par.stop
        w.stop.u = end_stop.Input(piston.x, piston.v, stop.x_rest, stop.x_end)
        force = w.pads.f.F_cl + end_stop.load(w.stop.f)
        carrier = _carrier(w.rotor.x, w.par)
        w.screw.u = ball_screw.Input(carrier.theta, carrier.omega, force)
        load = ball_screw.output(w.screw.u, w.screw.par).load
        w.gear.u = planetary_gear.Input(w.rotor.x.theta, w.rotor.x.omega, load)
        w.dry.u = load_friction.Input(w.rotor.x.omega, w.pads.f.F_cl)
        load = planetary_gear.output(w.gear.u, w.gear.par).load
        w.rotor.u = rotor.Input(w.torque, load, 0.0)

    def friction(self, w: Self) -> tuple[Bounds, ...]:
        """Return the limits of the dry friction torque on the shaft."""
        limit = load_friction.output(w.dry.u, w.dry.par).torque
        return ((-limit, limit),)

    def power(self, w: Self) -> dict[str, float]:
        """Return the power of source and dry friction, and 1 while the shaft is stuck."""
        battery = battery_supply.power_source(w.supply.u, w.supply.par)
        return {
            "E_source": w.voltage * w.motor.x.i if w.par.drive == "voltage" else battery,
            "E_friction": load_friction.power_loss(w.reaction[0], w.rotor.x.omega),
            "t_stuck": ops.where(w.rotor.x.omega == 0, 1.0, 0.0),
        }

    def record(self, w: Self) -> dict[str, float]:
        """Return the recorded signals other than states, wires and losses."""
        battery = battery_supply.power_source(w.supply.u, w.supply.par)
        return {
            "T_fr": -w.reaction[0],
            "F_stop": end_stop.load(w.stop.f),
            "stuck": ops.where(w.rotor.x.omega == 0, 1.0, 0.0),
            "P_el": w.voltage * w.motor.x.i if w.par.drive == "voltage" else battery,
        }

    def tasks(self, par: Par) -> tuple[Task, ...]:
        """Return the controllers of the drive mode, from the outer loop inward."""
        current = Task("current", par.ecu.T_current, _reading(ecu.current_tick))
        if par.drive == "voltage":
            return (Task("source", par.ecu.T_current, _reading(ecu.source_tick)),)
        if par.drive == "current":
            return (current,)
        slow = ("force", ecu.force_tick), ("speed", ecu.speed_tick)
        outer = tuple(Task(name, par.ecu.T_force, _reading(law)) for name, law in slow)
        return (*outer, current)

    def watch(self, recording: Any, par: Any) -> list[str]:
        """Return the warnings about a recording."""
        warnings = super().watch(recording, par)
        if "F_stop" in recording and bool((recording["F_stop"] != 0).any()):
            warnings.append("the piston reached an end stop")
        return warnings


def travel(x: rotor.State, par: Par) -> ball_screw.Output:
    """Return the motion of the piston."""
    carrier = _carrier(x, par)
    return ball_screw.output(ball_screw.Input(carrier.theta, carrier.omega, 0.0), par.screw)


def _carrier(x: rotor.State, par: Par) -> planetary_gear.Output:
    return planetary_gear.output(planetary_gear.Input(x.theta, x.omega, 0.0), par.gear)


def _electrics(w: EmbCaliper) -> tuple[float, float]:
    """Return motor voltage and battery current of the drive mode."""
    i = w.motor.x.i
    if w.par.drive == "voltage":
        return w.m.v_source, 0.0 * i
    i_dc = w.m.duty * i
    bus = battery_supply.output(battery_supply.Input(i_dc), w.supply.par).v_bus
    bridge = h_bridge.output(h_bridge.Input(duty=w.m.duty, v_bus=bus, i=i))
    return bridge.v, bridge.i_dc


def _reading(law: Callable[..., ecu.Memory]) -> Callable[[Any, Any, Any, Any], ecu.Memory]:
    """Return a controller's tick with the sensor readings."""

    def tick(x: Any, m: ecu.Memory, u: ecu.Stimulus, par: Par) -> ecu.Memory:
        piston = travel(rotor.State(x.theta, x.omega), par)
        F_cl = floating_caliper.forces(floating_caliper.Input(piston.x, piston.v), par.caliper)
        return law(ecu.Readings(F_cl.F_cl, x.theta, x.omega, x.i), m, u, par)

    return tick
