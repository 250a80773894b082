"""Your own actuator in one file: a servo axis with dry friction.

A DC motor turns an inertia against viscous friction and against dry friction that is larger
forward than backward. An encoder counts its angle. Control is a cascade: position (P) and speed
(PI with anti-wind-up) at 1 kHz, current (PI, taken from the package) at 10 kHz.

Without the integral part the axis comes to rest, exactly, where the friction can hold what the
position error asks of the motor: short of the target by up to T_forward / (K_e k_p k_angle) when
it arrives forward, by up to the same with T_backward when it arrives backward. With the integral
part it creeps on until the encoder shows the target, and rests as exactly.
"""

import math
from argparse import ArgumentParser
from typing import Annotated, NamedTuple

import numpy as np
from matplotlib.figure import Figure
from pydantic import Field

import bywire
from bywire.control import current_pi
from bywire.core import ops
from bywire.core.model import Task
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Current, Duration, Inertia, RotaryDamping, Torque, Unit, Voltage
from bywire.core.signals import Angle, Energy, Signal, Speed, zeros
from bywire.plant import dc_motor

Amps = Annotated[float, Signal("A", "current")]


class Parameters(ParameterSet):
    """Every number has a unit and a range, which are checked."""

    motor: dc_motor.Parameters
    V_bus: Voltage
    J: Inertia
    d: RotaryDamping
    T_forward: Torque
    T_backward: Torque
    count: Annotated[float, Unit("rad", 1e-3), Field(gt=0)]
    k_angle: Annotated[float, Unit("1/s", 30.0), Field(gt=0)]
    k_p: Annotated[float, Unit("A*s/rad"), Field(gt=0)]
    k_i: Annotated[float, Unit("A/rad"), Field(ge=0)]
    i_max: Current
    T_outer: Duration
    current: current_pi.Parameters
    T_inner: Duration


class State(NamedTuple):
    """What the engine integrates."""

    i: Amps
    theta: Angle
    omega: Speed


class Memory(NamedTuple):
    """What the controllers hold between their ticks; `held` are integral parts."""

    seen: Angle
    i_ref: Amps
    i_held: Amps
    duty: Annotated[float, Signal("1", "duty cycle")]
    duty_held: Annotated[float, Signal("1", "duty cycle")]


class Stimulus(NamedTuple):
    """What acts from outside."""

    target: Angle


class Flow(NamedTuple):
    """What the engine integrates along: the energies."""

    E_source: Energy
    E_lost: Energy


class Output(NamedTuple):
    """What is recorded."""

    theta: Angle
    omega: Speed
    E_source: Energy
    E_lost: Energy
    E_stored: Energy


def outer(x, m, u, par):
    """Control position and speed; the integral part waits while the current is limited."""
    seen = par.count * ops.floor(x.theta / par.count + 0.5)
    error = par.k_angle * (u.target - seen) - (seen - m.seen) / par.T_outer
    wanted = par.k_p * error + m.i_held
    growth = ops.where(ops.fabs(wanted) < par.i_max, par.k_i * error, 0.0)
    i_ref = ops.clip(wanted, -par.i_max, par.i_max)
    return m._replace(seen=seen, i_ref=i_ref, i_held=m.i_held + par.T_outer * growth)


def inner(x, m, u, par):
    """Control the current."""
    state, reading = current_pi.State(m.duty_held), current_pi.Input(m.i_ref, x.i)
    state, out = current_pi.output(state, reading, par.T_inner, par.current)
    return m._replace(duty=out.duty, duty_held=state.integral)


class ServoAxis:
    """The wiring: mass_k dx_k/dt = balance_k, and what is not smooth beside it."""

    name = "servo-axis"
    State, Memory, Stimulus, Flow, Output = State, Memory, Stimulus, Flow, Output
    frictions = ("omega",)  # this state's equation carries a set-valued force
    limits = usually_open = ()

    def tasks(self, par):
        """Return the controllers and their sample times; they share one memory."""
        return Task("outer", lambda p: p.T_outer, outer), Task("inner", lambda p: p.T_inner, inner)

    def mass(self, xe, par):
        """Return inductance, unity, inertia."""
        return State(par.motor.L_m, 1.0, par.J)

    def balance(self, x, xe, m, par, contact):
        """Return voltage, speed, torque."""
        supply = dc_motor.Input(m.duty * par.V_bus, x.omega)
        voltage = dc_motor.balance(dc_motor.State(x.i), supply, par.motor).i
        return State(voltage, x.omega, par.motor.K_e * x.i - par.d * x.omega)

    def bounds(self, x, xe, m, par, contact):
        """Return the dry friction while turning forward, backward; at rest all between."""
        return ((-par.T_forward, par.T_backward),)

    def compliance(self, par):
        """Return nothing: there is no contact."""
        return ()

    def gap(self, x, xe, par):
        """Return nothing: there is no contact."""
        return ()

    def powers(self, x, rate, m, par, contact, reaction):
        """Return the power of the source, and what copper and friction take."""
        copper = dc_motor.power_loss(dc_motor.State(x.i), par.motor)
        friction = (par.d * x.omega - reaction[0]) * x.omega
        return Flow(E_source=m.duty * par.V_bus * x.i, E_lost=copper + friction)

    def output(self, x, m, par, contact, reaction, flow):
        """Return what is recorded."""
        stored = dc_motor.energy(dc_motor.State(x.i), par.motor) + 0.5 * par.J * x.omega * x.omega
        return Output(x.theta, x.omega, *flow, stored)


PAR = Parameters(
    motor=dc_motor.Parameters(R_m=0.35, L_m=1e-4, K_e=0.0304), V_bus=12.0, J=2e-4, d=1e-5,
    T_forward=0.03, T_backward=0.015, count=2e-4 * math.pi, k_angle=25.0, k_p=0.5, k_i=10.0,
    i_max=15.0, T_outer=1e-3, T_inner=1e-4,
    current=current_pi.Parameters(k_p=0.02, k_i=80.0, T_t=1e-3, D_max=1.0),
)  # fmt: skip
TARGET = 3.0  # for one second; then back to zero for another one


def move(par):
    """Return the trajectory there and back."""
    run = bywire.Run(
        ServoAxis(), par, state=zeros(State), memory=zeros(Memory), duration=2.0,
        stimulus=lambda t: np.where(t < 1.0, TARGET, 0.0)[:, None],
    )  # fmt: skip
    return bywire.simulate(run)


if __name__ == "__main__":
    parser = ArgumentParser(description="Move a servo axis there and back.")
    parser.add_argument("--plot", metavar="FILE", help="picture of the angle over time")
    file = parser.parse_args().plot
    p_only, with_i = move(PAR.replace({"k_i": 0.0})), move(PAR)
    if file:
        figure = Figure(layout="constrained")
        axes = figure.subplots()
        axes.plot(p_only.time, p_only["theta"], with_i.time, with_i["theta"])
        axes.legend(["P", "PI"])
        axes.set(xlabel="time [s]", ylabel="angle [rad]")
        figure.savefig(file)

    short = TARGET - p_only["theta"][999], p_only["theta"][1999]
    band = 1.0 / (PAR.motor.K_e * PAR.k_p * PAR.k_angle)
    assert 0.0 < short[0] < PAR.T_forward * band
    assert 0.0 < short[1] < PAR.T_backward * band
    assert abs(with_i["theta"][999] - TARGET) < 0.5 * PAR.count
    assert abs(with_i["theta"][1999]) < 0.5 * PAR.count
    for run in (p_only, with_i):
        omega = run["omega"]
        assert not np.concatenate((omega[800:1000], omega[1800:])).any()  # zero, not small
        left = run["E_source"] - run["E_lost"] - run["E_stored"]
        assert np.max(np.abs(left)) < 1e-9 * run["E_source"][-1]
