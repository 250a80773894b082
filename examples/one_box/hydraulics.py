"""The brake: pedal, plunger, valves, accumulator, and the brakes that they press."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ClassVar, TypeVar

from bywire.authoring import Assembly, Bounds, Integral, Part, Role, Shown, Task, Wire
from bywire.core import ops
from bywire.plant import (
    accumulator,
    ball_screw_gear,
    battery_supply,
    brake_fluid,
    check_valve,
    dc_motor,
    end_stop,
    h_bridge,
    master_cylinder,
    orifice,
    pedal_simulator,
    reservoir_port,
    return_pump,
    seal_friction,
    shaft,
    solenoid_valve,
    stiffening_caliper,
)
from one_box import ecu
from one_box.elements import pedal_rod
from one_box.parameters import OneBoxParameters

ParT = TypeVar("ParT", bound=OneBoxParameters)
MemoryT = TypeVar("MemoryT")


class Hydraulics(Assembly[ParT, MemoryT]):
    """Parts and wires of the brake, alone or at a wheel.

    One dry friction acts on the motor shaft with its seals. The plunger's chamber pressure is
    one-sided, because the reservoir makes up missing fluid.
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
    gear = Part(ball_screw_gear, output={"x": "x_mc"})
    seal = Part(seal_friction)
    E_friction = Integral("J", "dry friction of screw and seals", role=Role("sink", "dry friction"))
    chamber = Part(master_cylinder, par="plunger", state={"p": "p_mc"}, loss="E_damping")
    port = Part(reservoir_port)
    E_port = Integral(
        "J", "energy lost through the port", role=Role("sink", "reservoir", returns="taken")
    )
    stop = Part(end_stop, work="W_stop", loss="E_stop", rarely=True)
    line = Part(orifice, loss="E_line")
    others = Part(stiffening_caliper, suffix="_o", which="other brakes")
    inlet = Part(solenoid_valve, suffix="_in", which="inlet valve", loss="E_inlet")
    check = Part(check_valve, loss="E_check")
    outlet = Part(solenoid_valve, suffix="_out", which="outlet valve", loss="E_outlet")
    caliper = Part(stiffening_caliper)
    pump = Part(return_pump, state={"V": "V_pump"}, loss="E_pump")
    pump_motor = Part(dc_motor, suffix="_p", which="pump motor", loss="E_copper_p")
    pump_shaft = Part(shaft, suffix="_p", which="pump", loss="E_viscous_p")
    store = Part(accumulator, par="accumulator", state={"V": "V_acc"})
    V_given = Integral("m**3", "volume from the reservoir")
    V_released = Integral("m**3", "volume released into the accumulator")
    V_pumped = Integral("m**3", "volume returned by the pump")
    V_squeezed = Integral("m**3", "compression of the fluid in the plunger's chamber")

    voltage = Wire("V", "motor voltage", 5.0)
    i_dc = Wire("A", "battery current", 20.0)
    torque = Wire("N*m", "motor torque", 2.0)
    T_pump = Wire("N*m", "load of the return pump", 0.1)
    load = Wire("N", "load on the plunger", 2e3)
    q_in = Wire("m**3/s", "flow into the wheel", 1e-5)
    q_out = Wire("m**3/s", "flow out of the wheel", 1e-5)
    x_foot = Shown("m", "pedal travel", 0.05)
    q_pump = Wire("m**3/s", "flow out of the return pump", 3e-6)
    q_suck = Wire("m**3/s", "flow into the return pump", 3e-6)
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
        makeup, fluid = w.reaction[len(self.frictions)], w.par.fluid
        p = w.chamber.x.p
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
            "V_released": w.q_out,
            "V_pumped": w.q_pump,
            "V_squeezed": chamber * w.rate.p_mc,
        }

    def record(self, w: Any) -> dict[str, float]:
        """Return the recorded signals other than states, wires and losses."""
        return {
            **super().record(w),
            "x_foot": w.rod.par.i * w.rod.x.x,
            "V_missing": _missing(w),
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
            Task("coils", par.ecu.T_coil, _reading(ecu.coil_tick)),
        )

    def antilock(self, par: Any) -> tuple[Task, ...]:
        """Return the task of anti-lock control, if the brake is at a wheel."""
        return ()


def _pedal(w: Any) -> None:
    """Connect the pedal, its simulator and its stops."""
    rod = w.rod.x
    w.simulator.u = pedal_simulator.Input(rod.x, rod.v)
    w.pedal_stop.u = end_stop.Input(rod.x, rod.v, 0.0, w.par.x_pedal)
    force = pedal_simulator.force(w.simulator.u, w.simulator.par)
    w.rod.u = pedal_rod.Input(w.m.foot, force + end_stop.load(w.pedal_stop.f))


def _hydraulics(w: Any) -> None:
    """Connect plunger, valves, calipers and accumulator."""
    fluid, p, p_w = w.par.fluid, w.chamber.x.p, w.caliper.x.p
    p_acc = accumulator.pressure(w.store.x, w.store.par, fluid)
    w.pump.u = return_pump.Input(w.pump_shaft.x.theta, w.pump_shaft.x.omega, p_acc, p)
    pump = return_pump.output(w.pump.x, w.pump.u, w.pump.par, fluid)
    w.q_suck, w.q_pump, w.T_pump = pump.q_s, pump.q_d, pump.torque
    w.line.u = orifice.Input(p, w.others.x.p, 1.0)
    w.inlet.u = solenoid_valve.Input(w.m.close_on, p, p_w)
    w.check.u = check_valve.Input(p_w, p)
    w.outlet.u = solenoid_valve.Input(w.m.release_on, p_w, p_acc)
    to_others = orifice.flow(w.line.u, w.line.par, fluid)
    back = check_valve.flow(w.check.u, w.check.par, fluid)
    w.q_in = solenoid_valve.flow(w.inlet.x, w.inlet.u, w.inlet.par, fluid) - back
    w.q_out = solenoid_valve.flow(w.outlet.x, w.outlet.u, w.outlet.par, fluid)
    w.others.u = stiffening_caliper.Input(to_others)
    w.caliper.u = stiffening_caliper.Input(w.q_in - w.q_out)
    w.store.u = accumulator.Input(w.q_out - w.q_suck)
    piston = ball_screw_gear.output(w.gear.x, w.gear.par)
    w.port.u = reservoir_port.Input(piston.x - w.chamber.par.x_rest, p)
    leak = reservoir_port.output(w.port.u, w.port.par).G * p
    w.chamber.u = master_cylinder.Input(piston.x, piston.v, to_others + w.q_in + leak - w.q_pump)


def _drive(w: Any) -> None:
    """Connect battery, bridge, motor, screw and plunger, and the relay and motor of the pump."""
    piston = ball_screw_gear.output(w.gear.x, w.gear.par)
    ends = w.chamber.par
    w.stop.u = end_stop.Input(piston.x, piston.v, ends.x_rest, ends.x_end)
    i, duty = w.motor.x.i, w.m.duty
    w.i_dc = duty * i + w.m.pump * w.pump_motor.x.i
    w.supply.u = battery_supply.Input(w.i_dc)
    bus = battery_supply.output(w.supply.u, w.supply.par).v_bus
    w.voltage = h_bridge.output(h_bridge.Input(duty, bus, i)).v
    w.motor.u = dc_motor.Input(w.voltage, w.gear.x.omega)
    w.torque = dc_motor.output(w.motor.x, w.motor.par).torque
    w.pump_motor.u = dc_motor.Input(w.m.pump * bus, w.pump_shaft.x.omega)
    driven = dc_motor.output(w.pump_motor.x, w.pump_motor.par).torque
    w.pump_shaft.u = shaft.Input(driven - w.T_pump, 0.0)
    force = master_cylinder.output(w.chamber.x, w.chamber.u, w.chamber.par).force
    w.load = force + end_stop.load(w.stop.f)
    w.gear.u = ball_screw_gear.Input(w.torque, w.load, 0.0)
    w.seal.u = seal_friction.Input(w.gear.x.omega, w.chamber.x.p)


def _missing(w: Any) -> float:
    """Return the volume that plunger and reservoir gave and that is nowhere [m^3]."""
    cylinder = w.chamber.par
    start = w.par.ecu.pressure.theta_rest
    given = cylinder.A_mc * w.gear.par.k_g * (w.gear.x.theta - start) + w.flow.V_given
    wheel = stiffening_caliper.volume(w.caliper.x, w.caliper.par)
    others = stiffening_caliper.volume(w.others.x, w.others.par)
    pumped = w.pump.x.V - filled_pump(w.par).V
    return given - wheel - others - w.store.x.V - pumped - w.flow.V_squeezed


def _reading(law: Callable[..., Any]) -> Callable[[Any, Any, Any, Any], Any]:
    """Return a controller's tick with the sensor readings."""

    def tick(x: Any, m: Any, u: ecu.Stimulus, par: Any) -> Any:
        return law(ecu.Readings(x.p_mc, x.theta, x.i, x.x_rod), m, u, par)

    return tick


def filled_pump(par: OneBoxParameters) -> return_pump.State:
    """Return the state of a pump without void at a shaft angle of zero."""
    pump = par.pump
    return return_pump.State(return_pump.area(pump) * pump.e * ops.cos(pump.phase))


def released_parts(par: OneBoxParameters) -> dict[str, Any]:
    """Return the states of the parts of a released brake. The plunger is parked near its stop."""
    return {
        "rod": pedal_rod.State(-par.rod.F_0 / par.pedal_stop.k_stop, 0.0),
        "gear": ball_screw_gear.State(par.ecu.pressure.theta_rest, 0.0),
        "pump": filled_pump(par),
        "inlet": solenoid_valve.State(solenoid_valve.lift(0.0, par.inlet)),
        "outlet": solenoid_valve.State(solenoid_valve.lift(0.0, par.outlet)),
    }


def released_memory(par: OneBoxParameters) -> dict[str, float]:
    """Return the memory of the ECU of a released brake, without zeros."""
    theta = par.ecu.pressure.theta_rest
    return {"theta_ref": theta, "theta_last": theta}
