"""Known elements with their responses to a sine: saturation, dry friction, a swing without loss."""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

import numpy as np
from scipy.optimize import brentq

from bywire.core import ops
from bywire.core.model import Model, Task
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Duration, Force, Mass, Stiffness, TimeConstant
from bywire.core.signals import Signal
from bywire.simulation.run import Run

T_S = 50e-6


class Nothing(NamedTuple):
    """No energies."""

    none: Annotated[float, Signal("J", "unused")]


class Held(NamedTuple):
    """What the source holds."""

    u: Annotated[float, Signal("N", "source")]


class Moving(NamedTuple):
    """A velocity."""

    v: Annotated[float, Signal("m/s", "velocity")]


class Recorded(NamedTuple):
    """What answers, and whether it is at its limit or sticks."""

    y: Annotated[float, Signal("N", "answer")]
    flag: Annotated[float, Signal("1", "saturated or stuck")]


class System(Model):
    """What the elements have in common."""

    State, Memory, Stimulus, Flow, Output = Moving, Held, Held, Nothing, Recorded

    def powers(self, x, xe, rate, m, par, contact, reaction):
        """Return nothing."""
        return Nothing(0.0 * par.T_s)


class SaturationParameters(ParameterSet):
    """Limit and lag."""

    limit: Force
    tau: TimeConstant
    T_s: Duration


class Saturation(System):
    """A clipped input behind a first-order lag."""

    name = "saturation"

    def tasks(self, par):
        """Return the source that clips."""
        return (Task("source", par.T_s, lambda x, m, u, p: Held(ops.clip(u.u, -p.limit, p.limit))),)

    def mass(self, xe, par):
        """Return the time constant."""
        return Moving(par.tau)

    def balance(self, x, xe, m, par, contact):
        """Return the lag."""
        return Moving(m.u - x.v)

    def output(self, x, m, par, contact, reaction, flow):
        """Return the answer, and whether the source is clipped."""
        return Recorded(x.v, ops.where(ops.fabs(m.u) >= par.limit, 1.0, 0.0))


def saturation(size: float, par: SaturationParameters, f: float) -> complex:
    """Return the describing function of the clip times the lag of the held input."""
    s = min(par.limit / size, 1.0)
    N = 2.0 / math.pi * (math.asin(s) + s * math.sqrt(1.0 - s * s))
    keep = math.exp(-par.T_s / par.tau)
    return N * (1.0 - keep) / (np.exp(2j * math.pi * f * par.T_s) - keep)


class RubbingParameters(ParameterSet):
    """A mass on a rough floor."""

    m: Mass
    F_c: Force
    T_s: Duration


class Rubbing(System):
    """A mass with Coulomb friction; answers with its velocity."""

    name = "rubbing-mass"
    frictions = ("v",)

    def tasks(self, par):
        """Return the force's source."""
        return (Task("source", par.T_s, lambda x, m, u, p: Held(u.u)),)

    def mass(self, xe, par):
        """Return the mass."""
        return Moving(par.m)

    def balance(self, x, xe, m, par, contact):
        """Return the force."""
        return Moving(m.u + 0.0 * x.v)

    def bounds(self, x, xe, m, par, contact):
        """Return those of Coulomb friction."""
        return ((-par.F_c, par.F_c),)

    def output(self, x, m, par, contact, reaction, flow):
        """Return the velocity, and whether it sticks."""
        return Recorded(x.v, ops.where(x.v == 0, 1.0, 0.0))


def rubbing(size: float, par: RubbingParameters, f: float) -> tuple[complex, float]:
    """Return velocity over force (fundamental), and the share of the time in which it sticks.

    Sliding all the time, the velocity's zeros cut the force at the phase p with
    ``cos p = pi F_c / 2 A``; the friction is a square wave, whose fundamental is 4 F_c / pi. For
    A < 1.862 F_c it sticks until the force overcomes it, and slides until its momentum is gone.
    The force is held over a sample.
    """
    w, share = 2.0 * math.pi * f, par.F_c / size
    held = 0.5 * w * par.T_s / math.sin(0.5 * w * par.T_s) * np.exp(-0.5j * w * par.T_s)
    if share <= 1.0 / math.hypot(1.0, math.pi / 2.0):
        p = math.acos(0.5 * math.pi * share)
        friction = 4.0 / math.pi * share * np.exp(-1j * p)
        return held * (1.0 - friction) / (1j * w * par.m), 0.0
    start = math.asin(share)

    def speed(a: float) -> float:
        return size / (w * par.m) * (math.cos(start) - np.cos(a) - share * (a - start))

    end = brentq(speed, start + 0.1, start + math.pi - 1e-9)
    a = np.linspace(start, end, 20001)
    half = np.trapezoid(speed(a) * np.exp(-1j * a), a)
    return held * 2j / math.pi * half / size, 1.0 - (end - start) / math.pi


class Swing(NamedTuple):
    """Position and velocity."""

    x: Annotated[float, Signal("m", "position")]
    v: Annotated[float, Signal("m/s", "velocity")]


class SwingingParameters(ParameterSet):
    """A mass on a spring."""

    m: Mass
    k: Stiffness
    T_s: Duration


class Swinging(Rubbing):
    """A mass on a spring without any loss: what it once did never dies."""

    name = "swinging-mass"
    State = Swing
    frictions = ()

    def mass(self, xe, par):
        """Return the mass."""
        return Swing(1.0, par.m)

    def balance(self, x, xe, m, par, contact):
        """Return velocity and force."""
        return Swing(x.v, m.u - par.k * x.x)

    def bounds(self, x, xe, m, par, contact):
        """Return none."""
        return ()


def swinging(t, size: float, par: SwingingParameters, f: float):
    """Return the velocity after a start from rest into a sine: its own swing and the forced one."""
    w, own = 2.0 * math.pi * f, math.sqrt(par.k / par.m)
    return size * w / (par.k - par.m * w * w) * (np.cos(w * t) - np.cos(own * t))


SATURATION = SaturationParameters(limit=2.0, tau=0.02, T_s=T_S)
RUBBING = RubbingParameters(m=0.5, F_c=3.0, T_s=T_S)
SWINGING = SwingingParameters(m=0.5, k=3000.0, T_s=T_S)


def at_rest(model: Model, par: ParameterSet) -> Run:
    """Return a run from rest without excitation."""
    start = model.State(*(0.0 for _ in model.State._fields))
    return Run(model, par, start, Held(0.0), lambda t: np.zeros((t.size, 1)), 1.0, T_S / 2, T_S)
