"""The motorcycle brake: DC motor, ball screw, master cylinder, pipeline, caliper, and its ECU.

Source: A. Dardanelli, G. Alli, S. M. Savaresi, "Modeling and control of an electro-mechanical
brake-by-wire actuator for a sport motorbike", 5th IFAC Symposium on Mechatronic Systems, 2010.
"""

from __future__ import annotations

from typing import Annotated, ClassVar, NamedTuple

from bywire.assemblies import motorcycle_ecu
from bywire.assemblies.motorcycle_ecu import Memory, Readings, Stimulus
from bywire.assemblies.motorcycle_energy import Flow, rates, stored
from bywire.assemblies.motorcycle_parameters import MotorcycleParameters
from bywire.assemblies.motorcycle_plant import (
    State,
    Wires,
    cylinder_input,
    port_conductance,
    stop_input,
    wires,
)
from bywire.core import ops
from bywire.core.model import Bounds, Matrix, Task
from bywire.core.signals import Signal
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


class Output(NamedTuple):
    """What a recording of the motorcycle brake holds."""

    i: Annotated[float, Signal("A", "motor current", 5.0)]
    i_ref: Annotated[float, Signal("A", "current set point", 5.0)]
    i_star: Annotated[float, Signal("A", "current demand", 5.0)]
    i_dit: Annotated[float, Signal("A", "dither current", 1.0)]
    i_meas: Annotated[float, Signal("A", "measured current", 5.0)]
    duty: Annotated[float, Signal("1", "duty cycle", 0.3)]
    voltage: Annotated[float, Signal("V", "motor voltage", 5.0)]
    theta: Annotated[float, Signal("rad", "motor angle", 20.0)]
    omega: Annotated[float, Signal("rad/s", "motor speed", 20.0)]
    x_mc: Annotated[float, Signal("m", "piston travel", 7e-3)]
    p_mc: Annotated[float, Signal("Pa", "master-cylinder pressure", 2e6)]
    p_pd: Annotated[float, Signal("Pa", "caliper pressure", 2e6)]
    p_ref: Annotated[float, Signal("Pa", "pressure set point", 2e6)]
    p_meas: Annotated[float, Signal("Pa", "measured pressure", 2e6)]
    V_pedal: Annotated[float, Signal("V", "potentiometer voltage", 2.5)]
    q: Annotated[float, Signal("m**3/s", "flow toward the caliper", 1e-6)]
    Re: Annotated[float, Signal("1", "Reynolds number", 10.0)]
    torque: Annotated[float, Signal("N*m", "motor torque", 0.1)]
    T_fr: Annotated[float, Signal("N*m", "friction torque", 0.05)]
    F_stop: Annotated[float, Signal("N", "end-stop load on the piston", 100.0)]
    q_makeup: Annotated[float, Signal("m**3/s", "makeup flow from the reservoir", 1e-6)]
    stuck: Annotated[float, Signal("1", "shaft stuck")]
    at_stop: Annotated[float, Signal("1", "piston at an end stop")]
    sat_current: Annotated[float, Signal("1", "current demand saturated")]
    sat_duty: Annotated[float, Signal("1", "duty cycle saturated")]
    P_gear: Annotated[float, Signal("W", "gear loss power, signed")]
    P_el: Annotated[float, Signal("W", "electrical power from battery or source", 10.0)]
    E_source: Annotated[float, Signal("J", "energy from battery or source")]
    E_supply: Annotated[float, Signal("J", "loss in the supply's resistance")]
    E_copper: Annotated[float, Signal("J", "copper loss")]
    E_gear: Annotated[float, Signal("J", "loss of gear and screw, signed")]
    E_seal: Annotated[float, Signal("J", "loss of the seals' friction")]
    E_damping: Annotated[float, Signal("J", "loss of the fluid's damping")]
    E_pipeline: Annotated[float, Signal("J", "loss in the pipeline")]
    E_stop: Annotated[float, Signal("J", "loss in the end stops")]
    E_port: Annotated[float, Signal("J", "energy out through the reservoir port")]
    E_stored: Annotated[float, Signal("J", "stored energy")]
    W_shaft: Annotated[float, Signal("J", "work of the motor on the gear")]
    t_stuck: Annotated[float, Signal("s", "time stuck")]


class MotorcycleBrake:
    """Model of the brake for the engine; see ``bywire.core.model.Model``.

    One dry friction (seals, and the gear when ``directional``) on the shaft; the chamber's
    pressure is one-sided because the reservoir makes up what is missing; two end stops.
    """

    name: ClassVar[str] = "motorcycle-brake"
    State: ClassVar = State
    Memory: ClassVar = Memory
    Stimulus: ClassVar = Stimulus
    Flow: ClassVar = Flow
    Output: ClassVar = Output
    frictions: ClassVar[tuple[str, ...]] = ("omega",)
    limits: ClassVar[tuple[str, ...]] = ("p_mc",)
    usually_open: ClassVar[tuple[bool, ...]] = (True, True)

    def tasks(self, par: Par) -> tuple[Task, ...]:
        """Return the ECU's task, or that of an ideal source."""
        if par.drive.mode in ("voltage-source", "current-source"):
            return (Task("source", lambda p: float(p.drive.T_source), self._source),)
        return (Task("ecu", lambda p: float(p.ecu.T_s), self._ecu),)

    def _ecu(self, x: State, m: Memory, u: Stimulus, par: Par) -> Memory:
        return motorcycle_ecu.tick(Readings(p=x.y_p, i=x.y_i), m, u, par)

    def _source(self, x: State, m: Memory, u: Stimulus, par: Par) -> Memory:
        return motorcycle_ecu.source_tick(m, u, par)

    def mass(self, xe: State, par: Par) -> State:
        """Return inductance, inertia and fluid compliances."""
        cylinder = cylinder_input(xe, 0.0, par)
        return State(
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
        self, x: State, xe: State, m: Memory, par: Par, contact: tuple[float, ...]
    ) -> State:
        """Return voltage, torque and flow balances, and the filters' rates."""
        w = wires(x, m, par, contact)
        motor = dc_motor.balance(
            dc_motor.State(x.i), dc_motor.Input(w.voltage, x.omega), par.motor
        )
        shaft = ball_screw_gear.balance(
            ball_screw_gear.State(x.theta, x.omega),
            ball_screw_gear.Input(torque=w.torque, force=w.force, friction=0.0),
            par.gear,
        )
        leak = port_conductance(xe, par) * x.p_mc
        driven = par.drive.mode != "current-source"
        return State(
            i=motor.i if driven else 0.0 * x.i,
            theta=shaft.theta,
            omega=shaft.omega,
            p_mc=master_cylinder.balance(cylinder_input(x, w.q + leak, par), par.master_cylinder),
            p_pd=w.q,
            y_p=anti_alias_filter.rate(x.y_p, _pressure_reading(xe, par), par.anti_alias),
            y_i=anti_alias_filter.rate(
                x.y_i, current_sensor.reading(_sensed(xe, m, par), par.current_sensor),
                par.anti_alias,
            ),
        )

    def bounds(
        self, x: State, xe: State, m: Memory, par: Par, contact: tuple[float, ...]
    ) -> tuple[Bounds, ...]:
        """Return the limits of the dry friction torque on the shaft."""
        seal = seal_friction.output(seal_friction.Input(x.omega, x.p_mc), par.seal)
        load = wires(x, m, par, contact).force
        return (tuple(ball_screw_gear.friction_bounds(seal.T_p, seal.T_n, load, par.gear)),)

    def compliance(self, par: Par) -> tuple[Matrix, ...]:
        """Return the compliances of the two end stops, which do not touch each other."""
        c = end_stop.compliance(par.stop)
        return (((c,),), ((c,),))

    def gap(self, x: State, xe: State, par: Par) -> tuple[tuple[float, ...], ...]:
        """Return the damped overlaps at the two end stops."""
        d = end_stop.overlaps(stop_input(x, par), par.stop)
        return ((d.near,), (d.far,))

    def powers(
        self,
        x: State,
        rate: State,
        m: Memory,
        par: Par,
        contact: tuple[float, ...],
        reaction: tuple[float, ...],
    ) -> Flow:
        """Return the powers for the energy balance."""
        return rates(x, rate, m, par, contact, reaction)

    def output(
        self, x: State, m: Memory, par: Par, contact: tuple[float, ...],
        reaction: tuple[float, ...], flow: Flow,
    ) -> Output:
        """Return what is recorded at an instant."""
        w = wires(x, m, par, contact)
        friction, makeup = reaction
        torque = ball_screw_gear.Input(w.torque, w.force, friction)
        shaft = ball_screw_gear.State(x.theta, x.omega)
        acceleration = ball_screw_gear.balance(shaft, torque, par.gear).omega
        acceleration = acceleration / ball_screw_gear.inertia(par.gear)
        ideal = par.drive.mode in ("voltage-source", "current-source")
        P_el = w.voltage * w.current if ideal else par.supply.V_bat * w.i_dc
        F_stop = end_stop.load(end_stop.Forces(*contact))
        direct = {name: getattr(m, name) for name in Memory._fields if name in Output._fields}
        return Output(
            **direct,
            **flow._asdict(),
            i=w.current,
            voltage=w.voltage,
            theta=x.theta,
            omega=x.omega,
            x_mc=w.x_mc,
            p_mc=x.p_mc,
            p_pd=x.p_pd,
            q=w.q,
            Re=w.Re,
            torque=w.torque,
            T_fr=-friction,
            F_stop=F_stop,
            q_makeup=makeup,
            stuck=ops.where(x.omega == 0, 1.0, 0.0),
            at_stop=ops.where(F_stop == 0, 0.0, 1.0),
            P_gear=_gear_power(shaft, w, acceleration, friction, x, par),
            P_el=P_el,
            E_stored=stored(x, par),
        )


def _pressure_reading(xe: State, par: Par) -> float:
    """Return the pressure sensor's reading, value-only: the brake does not feel its sensor."""
    middle = par.pressure_sensor.place == "mid-pipeline"
    gauge = 0.5 * (xe.p_mc + xe.p_pd) if middle else xe.p_mc
    return pressure_sensor.reading(gauge + par.fluid.p_atm, par.pressure_sensor)


def _sensed(xe: State, m: Memory, par: Par) -> float:
    return m.i_source if par.drive.mode == "current-source" else xe.i


def _gear_power(
    shaft: ball_screw_gear.State, w: Wires, acceleration: float, friction: float, x: State, par: Par
) -> float:
    if par.gear.law == "paper":
        return ball_screw_gear.transmission_loss(shaft, w.torque, acceleration, par.gear)
    seal = seal_friction.output(seal_friction.Input(x.omega, x.p_mc), par.seal)
    applying = x.omega > 0
    return -friction * x.omega - ops.where(applying, seal.T_p, seal.T_n) * ops.fabs(x.omega)
