"""The motorcycle brake: DC motor, ball screw, master cylinder, pipeline, caliper, and its ECU.

Source: A. Dardanelli, G. Alli, S. M. Savaresi, "Modeling and control of an electro-mechanical
brake-by-wire actuator for a sport motorbike", 5th IFAC Symposium on Mechatronic Systems, 2010.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar, Self

from bywire.brakes.motorcycle import ecu, watch
from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.core import ops
from bywire.core.assembly import Assembly
from bywire.core.model import Bounds, Task
from bywire.core.parts import Integral, Part, Shown, Wire
from bywire.core.signals import Role, zeros
from bywire.core.watching import watched_by_elements
from bywire.plant import (
    anti_alias_filter,
    ball_screw_gear,
    battery_supply,
    brake_fluid,
    caliper,
    current_sensor,
    dc_motor,
    end_stop,
    h_bridge,
    master_cylinder,
    motor_heat,
    pipeline,
    piston_friction,
    pressure_sensor,
    reservoir_port,
    seal_friction,
)

Par = MotorcycleParameters
IDEAL = ("voltage-source", "current-source")
"""drive modes in which a source at the motor replaces battery, bridge and ECU"""


class MotorcycleBrake(Assembly[MotorcycleParameters, ecu.Memory]):
    """Model of the brake.

    The shaft has one dry friction (seals, and the gear when ``directional``). The chamber pressure
    is one-sided, because the reservoir makes up missing fluid. The piston has two end stops.
    """

    name: ClassVar[str] = "motorcycle-brake"
    Memory: ClassVar = ecu.Memory
    Stimulus: ClassVar = ecu.Stimulus
    frictions: ClassVar[tuple[str, ...]] = ("omega",)
    limits: ClassVar[tuple[str, ...]] = ("p_mc",)
    shared: ClassVar[tuple[str, ...]] = ("fluid", "pipeline", "caliper")

    E_source = Integral("J", "energy from battery or source", role=Role("source", "source"))
    supply = Part(battery_supply, loss="E_supply")
    motor = Part(dc_motor, loss="E_copper")
    gear = Part(ball_screw_gear, output={"x": "x_mc"})
    # Eq. (8) returns energy when the load drives the gear, at most the energy absorbed earlier.
    E_gear = Integral(
        "J",
        "signed loss of gear and screw",
        role=Role("sink", "gear and screw", returns="taken"),
    )
    seal = Part(seal_friction)
    E_seal = Integral("J", "seal friction loss", role=Role("sink", "seal friction"))
    chamber = Part(master_cylinder, par="master_cylinder", state={"p": "p_mc"}, loss="E_damping")
    line = Part(pipeline, par="pipeline", output=("q", "Re"), loss="E_pipeline")
    pads = Part(caliper, par="caliper", state={"p": "p_pd"})
    stop = Part(end_stop, work="W_stop", loss="E_stop", rarely=True)
    piston = Part(piston_friction)
    E_piston = Integral("J", "caliper piston friction loss", role=Role("sink", "caliper piston"))
    port = Part(reservoir_port)
    E_port = Integral(
        "J",
        "energy lost through port and leak, minus energy from warming fluid",
        role=Role("sink", "port, leak, warming fluid", returns="any"),  # which expands
    )
    W_shaft = Integral("J", "work of the motor on the gear")
    t_stuck = Integral("s", "time stuck", role=Role("standstill"))
    pressure_sensor = Part(pressure_sensor)
    current_sensor = Part(current_sensor)
    filter_p = Part(
        anti_alias_filter,
        par="anti_alias",
        state={"y": "y_p"},
        labels={"y": "filtered pressure reading"},
    )
    filter_i = Part(
        anti_alias_filter,
        par="anti_alias",
        state={"y": "y_i"},
        labels={"y": "filtered current reading"},
    )
    heat = Part(
        motor_heat,
        par="motor_heat",
        fixed=motor_heat.State._fields,
        outside=True,
        loss="E_motor_air",
    )

    current = Wire("A", "motor current", 5.0)
    voltage = Wire("V", "motor voltage", 5.0)
    i_dc = Wire("A", "battery current", 2.0)
    torque = Wire("N*m", "motor torque", 0.1)
    load = Wire("N", "load on the piston", 200.0)
    T_fr = Shown("N*m", "friction torque", 0.05)
    F_stop = Shown("N", "end-stop load on the piston", 100.0)
    q_makeup = Shown("m**3/s", "makeup flow from the reservoir", 1e-6)
    stuck = Shown("1", "shaft stuck")
    at_stop = Shown("1", "piston at an end stop")
    P_gear = Shown("W", "gear loss power, signed")
    P_el = Shown("W", "electrical power from battery or source", 10.0)
    E_warming = Shown("J", "copper loss that heats the motor", role=motor_heat.COPPER)
    E_winding = Shown("J", "heat in the motor's winding", role=motor_heat.WINDING)
    E_housing = Shown("J", "heat in the motor's housing", role=motor_heat.HOUSING)

    records: ClassVar[tuple[str, ...]] = (
        "i",
        "i_ref",
        "i_star",
        "i_dit",
        "i_meas",
        "duty",
        "voltage",
        "theta",
        "omega",
        "x_mc",
        "p_mc",
        "p_pd",
        "p_ref",
        "p_meas",
        "V_pedal",
        "q",
        "Re",
        "torque",
        "T_fr",
        "F_stop",
        "q_makeup",
        "stuck",
        "at_stop",
        "sat_current",
        "sat_duty",
        "P_gear",
        "P_el",
        "E_source",
        "E_supply",
        "E_copper",
        "E_gear",
        "E_seal",
        "E_damping",
        "E_pipeline",
        "E_stop",
        "E_port",
        "E_stored",
        "W_shaft",
        "t_stuck",
        "T_winding",
        "T_housing",
        "derated",
        "E_warming",
        "E_winding",
        "E_housing",
        "E_motor_air",
        "E_piston",
    )

    def wire(self, w: Self) -> None:
        """Connect the parts: electrics, piston, fluid, load, sensors."""
        warm = motor_heat.warmth(w.heat.xe, w.heat.par)
        w.motor.vary(R_m=w.motor.par.R_m * warm.R, K_e=w.motor.par.K_e * warm.K)
        w.current, w.voltage, w.i_dc = _electrics(w)
        w.supply.u = battery_supply.Input(w.i_dc)
        w.motor.u = dc_motor.Input(w.voltage, w.gear.x.omega)
        w.torque = dc_motor.output(dc_motor.State(w.current), w.motor.par).torque
        w.heat.u = motor_heat.Input(dc_motor.power_loss(dc_motor.State(w.current), w.motor.par))
        piston = ball_screw_gear.output(w.gear.x, w.gear.par)
        cylinder = w.chamber.par
        w.stop.u = end_stop.Input(piston.x, piston.v, cylinder.x_rest, cylinder.x_end)
        w.port.u = reservoir_port.Input(piston.x - cylinder.x_rest, w.chamber.x.p)
        w.piston.u = piston_friction.Input(w.chamber.x.p, w.pads.x.p)
        p_caliper = w.piston.call(piston_friction.fluid_pressure)
        w.line.u = pipeline.Input(w.chamber.x.p, p_caliper)
        sticks = w.piston.par.law == "sticking"
        through = pipeline.output(w.line.u, w.line.par, w.par.fluid)
        q = piston_friction.flow(w.piston.f) if sticks else through.q
        w.pads.u = caliper.Input(q)
        leak = _port_conductance(w) * w.chamber.x.p
        w.chamber.u = master_cylinder.Input(piston.x, piston.v, q + leak)
        force = master_cylinder.output(w.chamber.x, w.chamber.u, cylinder).force
        w.load = force + end_stop.load(w.stop.f)
        w.gear.u = ball_screw_gear.Input(w.torque, w.load, 0.0)
        w.seal.u = seal_friction.Input(w.gear.x.omega, w.chamber.x.p)
        # Values only, because the sensors do not act on the brake.
        w.pressure_sensor.u = pressure_sensor.Input(_gauge(w) + w.par.fluid.p_atm)
        seen = pressure_sensor.reading(w.pressure_sensor.u.p, w.pressure_sensor.par)
        w.filter_p.u = anti_alias_filter.Input(seen)
        by_source = w.par.drive.mode == "current-source"
        w.current_sensor.u = current_sensor.Input(w.m.i_source if by_source else w.motor.xe.i)
        seen = current_sensor.reading(w.current_sensor.u.i, w.current_sensor.par)
        w.filter_i.u = anti_alias_filter.Input(seen)

    def balance(
        self, x: Any, xe: Any, memory: ecu.Memory, par: Par, contact: tuple[float, ...]
    ) -> Any:
        """Return the right-hand sides; with a current source, the winding's state is constant."""
        rows = super().balance(x, xe, memory, par, contact)
        return rows._replace(i=0.0 * rows.i) if par.drive.mode == "current-source" else rows

    def friction(self, w: Self) -> tuple[Bounds, ...]:
        """Return the limits of the dry friction torque on the shaft."""
        seal = seal_friction.output(w.seal.u, w.seal.par)
        low, high = ball_screw_gear.friction_bounds(seal.T_p, seal.T_n, w.load, w.gear.par)
        return ((low, high),)

    def power(self, w: Self) -> dict[str, float]:
        """Return powers that split a loss, cross the boundary or depend on the drive mode."""
        friction, makeup = w.reaction
        gear, seal = _dry_losses(w, friction)
        loss = ball_screw_gear.transmission_loss(w.gear.x, w.torque, w.rate.omega, w.gear.par)
        ideal = w.par.drive.mode in IDEAL
        battery = battery_supply.power_source(w.supply.u, w.supply.par)
        port = reservoir_port.power_loss(w.port.u, w.port.par, w.par.fluid)
        port = port + caliper.power_loss(w.pads.x, w.pads.par, w.par.fluid)
        if w.pads.par.fluid_heat != "off":
            port = port - caliper.expansion_power(w.pads.x, w.pads.par, w.par.fluid)
        return {
            "E_source": w.voltage * w.current if ideal else battery,
            "E_copper": w.heat.u.P,
            "E_gear": gear + loss,
            "E_seal": seal,
            "E_piston": w.piston.call(piston_friction.power_loss),
            "E_port": port - brake_fluid.convected_power(makeup, w.chamber.x.p, w.par.fluid),
            "W_shaft": w.torque * w.gear.x.omega,
            "t_stuck": ops.where(w.gear.x.omega == 0, 1.0, 0.0),
        }

    def record(self, w: Self) -> dict[str, float]:
        """Return the recorded signals that are not states, wires or losses."""
        friction, makeup = w.reaction
        F_stop = end_stop.load(w.stop.f)
        ideal = w.par.drive.mode in IDEAL
        # With motor_heat.law = 'off' this flow is zero and needs no operation.
        heat, cold = motor_heat.stored(w.heat.x, w.heat.par), w.heat.par.law == "off"
        return {
            **ecu.shown(w.m, w.par),
            "i": w.current,
            "T_fr": -friction,
            "F_stop": F_stop,
            "q_makeup": makeup,
            "stuck": ops.where(w.gear.x.omega == 0, 1.0, 0.0),
            "at_stop": ops.where(F_stop == 0, 0.0, 1.0),
            "P_gear": _gear_power(w, friction),
            "P_el": w.voltage * w.current if ideal else w.supply.par.V_bat * w.i_dc,
            "E_warming": w.flow.E_motor_air if cold else w.flow.E_copper,
            "E_winding": w.flow.E_motor_air if cold else heat.winding,
            "E_housing": w.flow.E_motor_air if cold else heat.housing,
            "E_piston": 0.0 if w.piston.par.law == "off" else w.flow.E_piston,
        }

    def tasks(self, par: Par) -> tuple[Task, ...]:
        """Return the task of the ECU, or of an ideal source."""
        if par.drive.mode in IDEAL:
            return (Task("source", par.drive.T_source, _source),)
        return (Task("ecu", par.ecu.T_s, _ecu),)

    def rest(self, par: Par) -> tuple[Any, ecu.Memory]:
        """Return the piston at its retracted end, without pressure or current."""
        state = self.state(
            gear=ball_screw_gear.State(theta=par.master_cylinder.x_rest / par.gear.k_g, omega=0.0),
            filter_p=anti_alias_filter.State(
                pressure_sensor.reading(par.fluid.p_atm, par.pressure_sensor)
            ),
            filter_i=anti_alias_filter.State(current_sensor.reading(0.0, par.current_sensor)),
            heat=motor_heat.cold(par.motor_heat),
        )
        return state, zeros(ecu.Memory)

    def watch(self, recording: Any, par: Any) -> list[str]:
        """Return the warnings about a recording."""
        held = par.drive.mode == "current-source" and "i" in recording
        source = {"i_source": ("time", recording["i"].values)} if held else {}
        seen = recording.assign(source) if held else recording
        return watch.stop_warnings(recording, par) + super().watch(seen, par)

    def may_warn(self, rows: Any, pars: Sequence[Any]) -> Sequence[int]:
        """Return the cases for which ``watch`` may warn."""
        is_known = pars[0].drive.mode != "current-source" and self.are_silent(rows)
        return watch.cases_at_stops(rows) if is_known else range(len(pars))

    def watched(self, par: Any) -> tuple[str, ...]:
        """Return the signals that ``watch`` reads."""
        return (*watch.WATCHED, *watched_by_elements(self, par))


def _ecu(x: Any, m: ecu.Memory, u: ecu.Stimulus, par: Par) -> ecu.Memory:
    return ecu.tick(ecu.Readings(p=x.y_p, i=x.y_i), m, u, par)


def _source(x: Any, m: ecu.Memory, u: ecu.Stimulus, par: Par) -> ecu.Memory:
    return ecu.source_tick(ecu.Readings(p=x.y_p, i=x.y_i), m, u, par)


def _electrics(w: MotorcycleBrake) -> tuple[float, float, float]:
    """Return motor current, motor voltage and battery current of the drive mode."""
    m, i = w.m, w.motor.x.i
    if w.par.drive.mode == "current-source":
        # The winding's state stays at rest; the source supplies the voltage that the balance
        # requires.
        voltage = w.motor.par.R_m * m.i_source + w.motor.par.K_e * w.gear.x.omega
        return m.i_source, voltage, 0.0 * m.i_source
    if w.par.drive.mode == "voltage-source":
        return i, m.v_source, 0.0 * i
    bus = battery_supply.output(battery_supply.Input(i_dc=m.duty * i), w.supply.par)
    bridge = h_bridge.output(h_bridge.Input(duty=m.duty, v_bus=bus.v_bus, i=i))
    return i, bridge.v, bridge.i_dc


def _port_conductance(w: MotorcycleBrake) -> float:
    """Return the port's conductance [m^3/(s Pa)] as a value only, because it changes slowly."""
    travel = ball_screw_gear.output(w.gear.xe, w.gear.par).x
    place = reservoir_port.Input(travel - w.chamber.par.x_rest, w.chamber.xe.p)
    return reservoir_port.output(place, w.port.par).G


def _gauge(w: MotorcycleBrake) -> float:
    """Return the pressure [Pa] at the sensor's position."""
    if w.pressure_sensor.par.place == "mid-pipeline":
        ends = piston_friction.Input(w.chamber.xe.p, w.pads.xe.p)
        far = piston_friction.fluid_pressure(ends, w.piston.par, w.par.caliper)
        return 0.5 * (w.chamber.xe.p + far)
    return w.chamber.xe.p


def _dry_losses(w: MotorcycleBrake, friction: float) -> tuple[float, float]:
    """Return the power losses in the dry friction of gear and seals.

    The seals account for their friction at this speed, and the gear for the rest.
    """
    total = -friction * w.gear.x.omega
    if w.gear.par.law == "paper":
        return 0.0 * total, total
    loss = ops.fmin(seal_friction.power_loss(w.seal.u, w.seal.par), total)
    return total - loss, loss


def _gear_power(w: MotorcycleBrake, friction: float) -> float:
    """Return the gear's power loss [W]."""
    if w.gear.par.law == "paper":
        torque = ball_screw_gear.Input(w.torque, w.load, friction)
        acceleration = ball_screw_gear.balance(w.gear.x, torque, w.gear.par).omega
        acceleration = acceleration / ball_screw_gear.inertia(w.gear.par)
        return ball_screw_gear.transmission_loss(w.gear.x, w.torque, acceleration, w.gear.par)
    return -friction * w.gear.x.omega - seal_friction.power_loss(w.seal.u, w.seal.par)
