"""Pedal, plunger, inlet valve, and the brakes that they press."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ClassVar, TypeVar

from bywire.authoring import Assembly, Bounds, Integral, Part, Port, Role, Shown, Task, Wire
from bywire.plant import (
    ball_screw_gear,
    battery_supply,
    brake_fluid,
    check_valve,
    dc_motor,
    end_stop,
    h_bridge,
    master_cylinder,
    pedal_simulator,
    reservoir_port,
    seal_friction,
    solenoid_valve,
    stiffening_caliper,
)
from one_box import ecu
from one_box.elements import pedal_rod
from one_box.parameters import OneBoxParameters

ParT = TypeVar("ParT", bound=OneBoxParameters)
MemoryT = TypeVar("MemoryT")


class Hydraulics(Assembly[ParT, MemoryT]):
    """Parts and wires of the brake, alone or with its anti-lock valves.

    One dry friction acts on the motor shaft with its seals. The plunger's pressure is one-sided,
    because its cup seal admits fluid from the reservoir.
    """

    Stimulus: ClassVar = ecu.Stimulus
    frictions: ClassVar[tuple[str, ...]] = ("omega",)
    limits: ClassVar[tuple[str, ...]] = ("p_mc",)
    shared: ClassVar[tuple[str, ...]] = ("fluid",)

    E_source = Integral("J", "energy from the battery", role=Role("source", "battery"))
    E_foot = Integral("J", "energy from the driver's foot", role=Role("source", "driver's foot"))
    rod = Part(pedal_rod, state={"x": "x_rod", "v": "v_rod"})
    simulator = Part(pedal_simulator, loss="E_simulator")
    pedal_stop = Part(end_stop, work="W_pedal_stop", loss="E_pedal_stop", which="pedal")
    supply = Part(battery_supply, loss="E_supply")
    motor = Part(dc_motor, loss="E_copper")
    gear = Part(ball_screw_gear, output={"x": "x_mc"}, labels={"x": "plunger travel"})
    seal = Part(seal_friction)
    E_friction = Integral("J", "dry friction of screw and seals", role=Role("sink", "dry friction"))
    chamber = Part(
        master_cylinder,
        par="plunger",
        state={"p": "p_mc"},
        labels={"p": "plunger pressure"},
        loss="E_damping",
    )
    port = Part(reservoir_port)
    E_port = Integral(
        "J", "energy lost through the port", role=Role("sink", "reservoir", returns="taken")
    )
    stop = Part(end_stop, work="W_stop", loss="E_stop", rarely=True)
    separation = Part(solenoid_valve, suffix="_s", which="separation valve", loss="E_separation")
    others = Part(stiffening_caliper, suffix="_o", which="other brakes")
    inlet = Part(solenoid_valve, suffix="_in", which="inlet valve", loss="E_inlet")
    check = Part(check_valve, loss="E_check")
    caliper = Part(stiffening_caliper)
    V_given = Integral("m**3", "volume from the reservoir")
    V_filled = Integral("m**3", "volume that flowed into the wheel")
    V_squeezed = Integral("m**3", "compression of the fluid in the plunger's chamber")

    closed = Port("1", "inlet valve energized", 0.5)
    q_out = Port("m**3/s", "flow out of the wheel", 1e-5)
    q_pump = Port("m**3/s", "flow out of the return pump", 3e-6)
    i_pump = Port("A", "current of the return pump", 5.0)
    voltage = Wire("V", "motor voltage", 5.0)
    i_dc = Wire("A", "battery current", 20.0)
    torque = Wire("N*m", "motor torque", 2.0)
    load = Wire("N", "load on the plunger", 2e3)
    q_plunger = Wire("m**3/s", "flow out of the plunger", 1e-5)
    q_in = Wire("m**3/s", "flow into the wheel", 1e-5)
    x_foot = Shown("m", "pedal travel", 0.05)
    V_missing = Shown("m**3", "residual of the volume balance", 1e-9)

    def wire(self, w: Any) -> None:
        """Connect pedal, valves and calipers, and motor and plunger."""
        _pedal(w)
        _hydraulics(w)
        _drive(w)

    def friction(self, w: Any) -> tuple[Bounds, ...]:
        """Return the bounds of the shaft's friction."""
        seal = seal_friction.output(w.seal.u, w.seal.par)
        shaft = ball_screw_gear.friction_bounds(seal.T_p, seal.T_n, w.load, w.gear.par)
        return ((shaft.low, shaft.high),)

    def power(self, w: Any) -> dict[str, float]:
        """Return the powers and flows that do not follow from the parts."""
        fluid, p, makeup = w.par.fluid, w.chamber.x.p, w.reaction[len(self.frictions)]
        leak = reservoir_port.output(w.port.u, w.port.par).G * p
        lost = reservoir_port.power_loss(w.port.u, w.port.par, fluid)
        chamber = master_cylinder.mass(w.chamber.x, w.chamber.u, w.chamber.par, fluid)
        return {
            **super().power(w),
            "E_source": battery_supply.power_source(w.supply.u, w.supply.par),
            "E_foot": pedal_rod.foot_power(w.rod.x, w.rod.u, w.rod.par),
            "E_friction": -w.reaction[0] * w.gear.x.omega,
            "E_port": lost - brake_fluid.convected_power(makeup, p, fluid),
            "V_given": makeup - leak,
            "V_filled": w.q_in,
            "V_squeezed": chamber * w.rate.p_mc,
        }

    def record(self, w: Any) -> dict[str, float]:
        """Return the recorded signals other than states, wires and losses."""
        return {
            **super().record(w),
            "x_foot": w.rod.par.i * w.rod.x.x,
            "V_missing": _given(w) - self.held_volume(w),
        }

    def tasks(self, par: Any) -> tuple[Task, ...]:
        """Return the tasks that the drive mode needs, from the outer loop inward."""
        current = Task("current", par.ecu.T_current, _reading(ecu.current_tick))
        if par.drive == "current":
            return (current,)
        position = Task("position", par.ecu.T_position, _reading(ecu.position_tick))
        if par.drive == "position":
            return (position, current)
        return (
            Task("demand", par.ecu.T_s, _reading(ecu.demand_tick)),
            *self.antilock(par),
            Task("pressure", par.ecu.T_s, _reading(ecu.pressure_tick)),
            position,
            current,
            Task("separation", par.ecu.T_s, _reading(ecu.separate_tick)),
        )

    def antilock(self, par: Any) -> tuple[Task, ...]:
        """Return the tasks of anti-lock control, if the brake has it."""
        return ()

    def held_volume(self, w: Any) -> float:
        """Return the volume in all brakes, minus that at the released brake [m^3]."""
        wheel: float = stiffening_caliper.volume(w.caliper.x, w.caliper.par)
        return wheel + stiffening_caliper.volume(w.others.x, w.others.par)


def _pedal(w: Any) -> None:
    """Connect the pedal, its simulator and its stops."""
    rod = w.rod.x
    w.simulator.u = pedal_simulator.Input(rod.x, rod.v)
    w.pedal_stop.u = end_stop.Input(rod.x, rod.v, 0.0, w.par.x_pedal)
    force = pedal_simulator.force(w.simulator.u, w.simulator.par)
    w.rod.u = pedal_rod.Input(w.m.foot, force + end_stop.load(w.pedal_stop.f))


def _hydraulics(w: Any) -> None:
    """Connect plunger, separation and inlet valve, calipers and reservoir."""
    fluid, p, p_o, p_w = w.par.fluid, w.chamber.x.p, w.others.x.p, w.caliper.x.p
    w.separation.u = solenoid_valve.Input(w.m.separate_on, p, p_o)
    w.inlet.u = solenoid_valve.Input(w.closed, p_o, p_w)
    w.check.u = check_valve.Input(p_w, p_o)
    valve = w.separation
    w.q_plunger = solenoid_valve.flow(valve.x, valve.u, valve.par, fluid)
    back = check_valve.flow(w.check.u, w.check.par, fluid)
    w.q_in = solenoid_valve.flow(w.inlet.x, w.inlet.u, w.inlet.par, fluid) - back
    w.others.u = stiffening_caliper.Input(w.q_plunger + w.q_pump - w.q_in)
    w.caliper.u = stiffening_caliper.Input(w.q_in - w.q_out)
    piston = ball_screw_gear.output(w.gear.x, w.gear.par)
    w.port.u = reservoir_port.Input(piston.x - w.chamber.par.x_rest, p)
    leak = reservoir_port.output(w.port.u, w.port.par).G * p
    w.chamber.u = master_cylinder.Input(piston.x, piston.v, w.q_plunger + leak)


def _drive(w: Any) -> None:
    """Connect battery, bridge, motor, screw and plunger."""
    piston = ball_screw_gear.output(w.gear.x, w.gear.par)
    ends = w.chamber.par
    w.stop.u = end_stop.Input(piston.x, piston.v, ends.x_rest, ends.x_end)
    i, duty = w.motor.x.i, w.m.duty
    w.i_dc = duty * i + w.i_pump
    w.supply.u = battery_supply.Input(w.i_dc)
    bus = battery_supply.output(w.supply.u, w.supply.par).v_bus
    w.voltage = h_bridge.output(h_bridge.Input(duty, bus, i)).v
    w.motor.u = dc_motor.Input(w.voltage, w.gear.x.omega)
    w.torque = dc_motor.output(w.motor.x, w.motor.par).torque
    force = master_cylinder.output(w.chamber.x, w.chamber.u, w.chamber.par).force
    w.load = force + end_stop.load(w.stop.f)
    w.gear.u = ball_screw_gear.Input(w.torque, w.load, 0.0)
    w.seal.u = seal_friction.Input(w.gear.x.omega, w.chamber.x.p)


def _given(w: Any) -> float:
    """Return the volume from plunger and reservoir, without compression in the chamber [m^3]."""
    cylinder = w.chamber.par
    turned = w.gear.x.theta - w.par.ecu.pressure.theta_rest
    displaced: float = cylinder.A_mc * w.gear.par.k_g * turned
    outside: float = w.flow.V_given - w.flow.V_squeezed
    return displaced + outside


def _reading(law: Callable[..., Any]) -> Callable[[Any, Any, Any, Any], Any]:
    """Return a controller's tick with the sensor readings."""

    def tick(x: Any, m: Any, u: ecu.Stimulus, par: Any) -> Any:
        return law(ecu.Readings(x.p_mc, x.theta, x.i, x.x_rod), m, u, par)

    return tick


def released_parts(par: OneBoxParameters) -> dict[str, Any]:
    """Return the states of the parts of a released brake. The plunger is parked near its stop."""
    return {
        "rod": pedal_rod.State(-par.rod.F_0 / (par.pedal_stop.k_stop + par.simulator.k_1), 0.0),
        "gear": ball_screw_gear.State(par.ecu.pressure.theta_rest, 0.0),
        "separation": solenoid_valve.State(solenoid_valve.lift(0.0, par.separation)),
        "inlet": solenoid_valve.State(solenoid_valve.lift(0.0, par.inlet)),
    }


def released_memory(par: OneBoxParameters) -> dict[str, float]:
    """Return the memory of the ECU of a released brake, without zeros."""
    theta = par.ecu.pressure.theta_rest
    return {"theta_ref": theta, "theta_last": theta}
