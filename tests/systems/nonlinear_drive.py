"""A motor against a hardening spring and quadratic drag: nonlinear rows beside linear ones."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from bywire.core import ops
from bywire.core.model import Model, Task
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Duration, Factor, Gain
from bywire.core.signals import Signal


class Parameters(ParameterSet):
    """Voltage balance L, R, K; motion J, k_1, k_3, d_2; all in coherent units."""

    L: Factor
    R: Factor
    K: Factor
    J: Factor
    k_1: Gain
    k_3: Gain
    d_2: Gain
    T_s: Duration


class State(NamedTuple):
    """Current, angle, speed."""

    i: Annotated[float, Signal("A", "current")]
    theta: Annotated[float, Signal("rad", "angle")]
    omega: Annotated[float, Signal("rad/s", "speed")]


class Memory(NamedTuple):
    """Held voltage."""

    v: Annotated[float, Signal("V", "voltage")]


class Flow(NamedTuple):
    """Energies."""

    E_in: Annotated[float, Signal("J", "electrical energy")]
    E_lost: Annotated[float, Signal("J", "losses")]


class Output(NamedTuple):
    """Recorded signals."""

    i: Annotated[float, Signal("A", "current")]
    theta: Annotated[float, Signal("rad", "angle")]
    omega: Annotated[float, Signal("rad/s", "speed")]
    residual: Annotated[float, Signal("J", "energy in, less losses, less stored")]


class NonlinearDrive(Model):
    """Smooth, without friction or contact: the protocol's defaults."""

    name = "nonlinear-drive"
    State, Memory, Stimulus, Flow, Output = State, Memory, Memory, Flow, Output

    def tasks(self, par):
        """Return the task that holds the voltage."""
        return (Task("source", par.T_s, lambda x, m, u, p: Memory(u.v)),)

    def mass(self, xe, par):
        """Return inductance, unity, inertia."""
        return State(par.L, 1.0, par.J)

    def balance(self, x, xe, m, par, contact):
        """Return voltage, speed and torque."""
        spring = par.k_1 * x.theta + par.k_3 * x.theta * x.theta * x.theta
        drag = par.d_2 * ops.fabs(x.omega) * x.omega
        return State(m.v - par.R * x.i - par.K * x.omega, x.omega, par.K * x.i - spring - drag)

    def powers(self, x, xe, rate, m, par, contact, reaction):
        """Return the power of the source and the losses."""
        drag = par.d_2 * ops.fabs(x.omega) * x.omega * x.omega
        return Flow(m.v * x.i, par.R * x.i * x.i + drag)

    def output(self, x, m, par, contact, reaction, flow):
        """Return states and the residual of the energy balance."""
        square = x.theta * x.theta
        stored = 0.5 * (par.L * x.i * x.i + par.J * x.omega * x.omega + par.k_1 * square)
        stored = stored + 0.25 * par.k_3 * square * square
        return Output(x.i, x.theta, x.omega, flow.E_in - flow.E_lost - stored)


PARAMETERS = Parameters(L=1e-3, R=0.5, K=0.1, J=1e-3, k_1=2.0, k_3=5.0, d_2=2e-3, T_s=1e-3)
