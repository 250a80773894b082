"""Your own actuator in one file: a servo axis with dry friction.

A DC motor turns an inertia against viscous friction, and against dry friction that is larger
forward than backward. An encoder counts its angle. A position controller (P) and a speed controller
(PI with anti-windup) run at 1 kHz.

Without the integral term, the axis stops completely where friction balances the motor torque from
the position error. It stops short of the target by up to T R_m / (K_e k_p k_angle) plus half a
count, with the friction T in the direction of arrival. With the integral term, the axis creeps
until the encoder shows the target, and then also stops completely.
"""

from argparse import ArgumentParser
from typing import Annotated, NamedTuple

import numpy as np
from matplotlib.figure import Figure
from pydantic import Field

import bywire
from bywire.authoring import (
    Angle,
    Assembly,
    Brake,
    CitedSet,
    Duration,
    Integral,
    Limited,
    ParameterSet,
    Part,
    Role,
    Signal,
    Task,
    Torque,
    Unit,
    Voltage,
)
from bywire.core import ops
from bywire.plant import dc_motor, shaft


class Parameters(ParameterSet):
    """All parameters. bywire checks the unit and range of each."""

    motor: dc_motor.Parameters
    shaft: shaft.Parameters
    T_forward: Torque
    T_backward: Torque
    count: Annotated[float, Unit("rad", 1e-3), Field(gt=0, allow_inf_nan=False)]
    k_angle: Annotated[float, Unit("1/s", 30.0), Field(gt=0, allow_inf_nan=False)]
    k_p: Annotated[float, Unit("V*s/rad"), Field(gt=0, allow_inf_nan=False)]
    k_i: Annotated[float, Unit("V/rad"), Field(ge=0, allow_inf_nan=False)]
    v_max: Voltage
    T_s: Duration


class Memory(NamedTuple):
    """Memory of the controller between its ticks: measured angle, voltage, integral term."""

    seen: Angle
    v: Annotated[float, Signal("V", "voltage"), Limited("v_max")]
    v_i: Annotated[float, Signal("V", "integral term")]


class Stimulus(NamedTuple):
    """External inputs."""

    target: Angle


def control(x, m, u, par):
    """Run the cascade once. The integral term stops while the voltage is limited."""
    seen = par.count * ops.floor(x.theta / par.count + 0.5)
    error = par.k_angle * (u.target - seen) - (seen - m.seen) / par.T_s
    wanted = par.k_p * error + m.v_i
    growth = ops.where(ops.fabs(wanted) < par.v_max, par.k_i * error, 0.0)
    return Memory(seen, ops.clip(wanted, -par.v_max, par.v_max), m.v_i + par.T_s * growth)


class ServoAxis(Assembly[Parameters, Memory]):
    """Parts and wires. They determine states, masses, balances, energies and recorded signals."""

    name = "servo-axis"
    Memory, Stimulus = Memory, Stimulus
    frictions = ("omega",)  # this state's equation contains a set-valued force

    E_source = Integral("J", "energy from the source", role=Role("source", "source"))
    motor = Part(dc_motor, loss="E_copper")
    shaft = Part(shaft, loss="E_damping")
    E_friction = Integral("J", "dry friction loss", role=Role("sink", "dry friction"))

    def wire(self, w):
        """Connect the parts."""
        w.motor.u = dc_motor.Input(w.m.v, w.shaft.x.omega)
        w.shaft.u = shaft.Input(dc_motor.output(w.motor.x, w.motor.par).torque, 0.0)

    def friction(self, w):
        """Return the limits of the dry friction. At rest it is anywhere between them."""
        return ((-w.par.T_forward, w.par.T_backward),)

    def power(self, w):
        """Return the powers that the parts do not determine."""
        lost = -w.reaction[0] * w.shaft.x.omega
        return {"E_source": w.m.v * w.motor.x.i, "E_friction": lost}

    def tasks(self, par):
        """Return the controllers and their sample times. Several controllers share one memory."""
        return (Task("control", par.T_s, control),)


PAR = Parameters(
    motor=dc_motor.Parameters(R_m=0.35, L_m=1e-4, K_e=0.0304),
    shaft=shaft.Parameters(J=2e-4, d=1e-5),
    T_forward=0.03,
    T_backward=0.015,
    count=6e-4,
    k_angle=25.0,
    k_p=0.15,
    k_i=3.0,
    v_max=6.0,
    T_s=1e-3,
)
SERVO_1 = CitedSet("servo-1", "servo-axis", "", "a small axis", Parameters, PAR.flat())
BRAKE = Brake("servo-axis", "a motor that turns an inertia against dry friction", __name__)
TARGET = 3.0  # for one second, then back to zero for another second


def move(par):
    """Return the trajectory to the target and back."""
    state, memory = ServoAxis().rest(par)
    run = bywire.Run(
        ServoAxis(),
        par,
        state,
        memory,
        duration=2.0,
        stimulus=lambda t: np.where(t < 1.0, TARGET, 0.0)[:, None],
    )
    return bywire.simulate(run)


if __name__ == "__main__":
    parser = ArgumentParser(description="Move a servo axis to a target and back.")
    parser.add_argument("--plot", metavar="FILE", help="file for a plot of angle versus time")
    file = parser.parse_args().plot
    p_only, with_i = move(PAR.replace({"k_i": 0.0})), move(PAR)
    if file:
        figure = Figure(layout="constrained")
        axes = figure.subplots()
        axes.plot(p_only.time, p_only["theta"], with_i.time, with_i["theta"])
        axes.set(xlabel="time [s]", ylabel="angle [rad]")
        axes.legend(["P", "PI"])
        figure.savefig(file)

    band = PAR.motor.R_m / (PAR.motor.K_e * PAR.k_p * PAR.k_angle)  # per torque
    resolution = 0.5 * PAR.count
    assert 0.0 < TARGET - p_only["theta"][999] < PAR.T_forward * band + resolution
    assert 0.0 < p_only["theta"][1999] < PAR.T_backward * band + resolution
    assert abs(with_i["theta"][999] - TARGET) < resolution
    assert abs(with_i["theta"][1999]) < resolution
    for run in (p_only, with_i):
        omega = run["omega"]
        assert not np.concatenate((omega[800:1000], omega[1800:])).any()  # exactly zero
        lost = run["E_copper"] + run["E_damping"] + run["E_friction"]
        left = run["E_source"] - lost - run["E_stored"]
        assert np.max(np.abs(left)) < 1e-9 * run["E_source"][-1]
