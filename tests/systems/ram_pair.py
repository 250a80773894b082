"""Rams, each a motor on a screw between two stops, and assemblies that hold two of them."""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

from bywire.core.assembly import Assembly
from bywire.core.model import Task
from bywire.core.parameters import ParameterSet
from bywire.core.parts import Integral, Part, Sub, Wire
from bywire.core.quantities import Length, Stiffness, Torque
from bywire.core.signals import Role, Signal, zeros
from bywire.core.wires import Port
from bywire.plant import ball_screw_gear, current_sensor, dc_motor, end_stop


class Parameters(ParameterSet):
    """A motor on a screw between two stops, with dry friction."""

    motor: dc_motor.Parameters
    gear: ball_screw_gear.Parameters
    stop: end_stop.Parameters
    sensor: current_sensor.Parameters
    stroke: Length
    T_dry: Torque


class Held(NamedTuple):
    """What the controller holds."""

    v: Annotated[float, Signal("V", "voltage", 6.0)]
    x_seen: Annotated[float, Signal("m", "travel as sampled", 1e-3, set_point_of="theta")]


class Demand(NamedTuple):
    """What is demanded."""

    v_set: Annotated[float, Signal("V", "demanded voltage", 6.0)]
    noise_v: Annotated[float, Signal("1", "noise of the voltage")]


def sampled(x: Any, m: Held, u: Demand, par: Parameters) -> Held:
    return Held(u.v_set + 0.1 * u.noise_v - 0.2 * m.v, par.gear.k_g * x.theta)


class Ram(Assembly[Parameters, Held]):
    """A small actuator with all that an assembly can have, but for a limit."""

    name = "ram"
    Memory, Stimulus = Held, Demand
    frictions: Any = ("omega",)
    motor = Part(dc_motor, loss="E_copper")
    gear = Part(ball_screw_gear, output={"x": "x"})
    stop = Part(end_stop, work="W_stop", loss="E_stop")
    sensor = Part(current_sensor)
    E_source = Integral("J", "energy of the source", role=Role("source", "source"))
    W_load = Integral("J", "work on the load", role=Role("sink", "load"))
    E_dry = Integral("J", "dry friction", role=Role("sink", "dry friction"))
    load = Port("N", "load from without", 10.0)
    torque = Wire("N*m", "torque of the motor", 0.1)

    def wire(self, w):
        w.torque = dc_motor.output(w.motor.x, w.motor.par).torque
        piston = ball_screw_gear.output(w.gear.x, w.gear.par)
        w.stop.u = end_stop.Input(piston.x, piston.v, 0.0, w.par.stroke)
        w.motor.u = dc_motor.Input(w.m.v, w.gear.x.omega)
        force = end_stop.load(w.stop.f) + w.load
        w.gear.u = ball_screw_gear.Input(w.torque, force, 0.0)
        w.sensor.u = current_sensor.Input(w.motor.xe.i)

    def friction(self, w):
        return ((-w.par.T_dry, 0.5 * w.par.T_dry),)

    def power(self, w):
        (friction,) = w.reaction
        speed = w.par.gear.k_g * w.gear.x.omega
        return {
            "E_source": w.m.v * w.motor.x.i,
            "W_load": w.load * speed,
            "E_dry": -friction * w.gear.x.omega,
        }

    def tasks(self, par):
        return (Task("source", 1e-3, sampled),)

    def rest(self, par):
        return self.state(gear=ball_screw_gear.State(theta=1.0, omega=0.0)), zeros(Held)


PAR = Parameters(
    motor=dc_motor.Parameters(R_m=0.35, L_m=1e-4, K_e=0.03),
    gear=ball_screw_gear.Parameters(k_g=3e-4, eta_g=1.0, law="directional", J_mot=3e-5, M_mc=0.1),
    stop=end_stop.Parameters(k_stop=1e6, tau_stop=1e-4),
    sensor=current_sensor.Parameters(i_low=-30.0, i_high=30.0),
    stroke=1e-3,
    T_dry=0.02,
)


class PairParameters(ParameterSet):
    """Two rams, and a spring between their pistons."""

    left: Parameters
    right: Parameters
    k: Stiffness


class Pair(Assembly[PairParameters, Any]):
    """Two of a kind, each with a demand of its own."""

    name = "pair"
    left = Sub(Ram, prefix="left_")
    right = Sub(Ram, prefix="right_", label="the other one")

    def wire(self, w):
        w.left.load, w.right.load = 0.0, 0.0


class Coupled(Pair):
    """The same with a spring between both pistons."""

    name = "coupled"
    E_spring = Integral("J", "energy in the spring", role=Role("sink", "spring", returns="any"))
    force = Wire("N", "force of the spring", 10.0)

    def wire(self, w):
        stretched = w.par.k * (w.left.gear.x.theta - w.right.gear.x.theta)
        w.force = stretched * w.left.gear.par.k_g
        w.left.load, w.right.load = w.force, -1.0 * w.force

    def power(self, w):
        moved = w.left.gear.x.omega - w.right.gear.x.omega
        return {"E_spring": w.force * moved * w.left.gear.par.k_g}


BOTH = PairParameters(left=PAR, right=PAR.replace({"motor.R_m": 0.5, "T_dry": 0.03}), k=2e3)
