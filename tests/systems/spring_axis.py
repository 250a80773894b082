"""A brake in one file, as a user writes it: a mass on a spring with dry friction, two forces.

It declares a model and a parameter set and nothing else; it records no energies and no modes. Its
friction grows with its travel, and its answers have closed forms.
"""

from typing import Annotated, NamedTuple

from bywire.core.brake import Brake
from bywire.core.catalog import CitedSet
from bywire.core.model import Model, Task
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Damping, Duration, Force, Mass, Stiffness
from bywire.core.signals import Signal


class Parameters(ParameterSet):
    """Mass, spring, damping, friction; the one task holds the force for T_s."""

    m: Mass
    k: Stiffness
    d: Damping
    F_c: Force
    k_c: Stiffness
    """friction by travel"""
    T_s: Duration


class State(NamedTuple):
    """Position and velocity."""

    x: Annotated[float, Signal("m", "travel", 0.01)]
    v: Annotated[float, Signal("m/s", "velocity", 0.1)]


class Memory(NamedTuple):
    """Forces held between ticks."""

    F: Annotated[float, Signal("N", "force", 100.0)]
    F_load: Annotated[float, Signal("N", "load held", 100.0)]


class Stimulus(NamedTuple):
    """Forces demanded, and noise that nothing uses."""

    F_set: Annotated[float, Signal("N", "force demand", 100.0)]
    load: Annotated[float, Signal("N", "load", 50.0)]
    noise_x: Annotated[float, Signal("1", "noise")]


class Flow(NamedTuple):
    """Integral of the force."""

    impulse: Annotated[float, Signal("N*s", "impulse")]


class Output(NamedTuple):
    """Recorded signals."""

    x: Annotated[float, Signal("m", "travel", 0.01)]
    v: Annotated[float, Signal("m/s", "velocity", 0.1)]
    F: Annotated[float, Signal("N", "force", 100.0)]


def control(x, m, u, par):
    """Hold the demands."""
    return Memory(u.F_set, u.load)


class SpringAxis(Model):
    """m dv/dt = F - F_load - k x - d v - friction."""

    name = "spring-axis"
    State, Memory, Stimulus, Flow, Output = State, Memory, Stimulus, Flow, Output
    frictions = ("v",)

    def tasks(self, par):
        """Return the one task."""
        return (Task("control", par.T_s, control),)

    def mass(self, xe, par):
        """Return unity and the mass."""
        return State(1.0, par.m)

    def balance(self, x, xe, m, par, contact):
        """Return velocity and force."""
        return State(x.v, m.F - m.F_load - par.k * x.x - par.d * x.v)

    def bounds(self, x, xe, m, par, contact):
        """Return the friction of both directions."""
        F = par.F_c + par.k_c * xe.x
        return ((-F, F),)

    def powers(self, x, xe, rate, m, par, contact, reaction):
        """Return the force."""
        return Flow(m.F)

    def output(self, x, m, par, contact, reaction, flow):
        """Return what is recorded."""
        return Output(x.x, x.v, m.F)


VALUES = {"m": 2.0, "k": 1e4, "d": 60.0, "F_c": 5.0, "k_c": 200.0, "T_s": 1e-3}
SET = CitedSet("spring-axis-one", "spring-axis", "", "a mass on a spring", Parameters, VALUES)
BRAKE = Brake("spring-axis", "a mass on a spring with dry friction", __name__)
