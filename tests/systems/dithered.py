"""A rough mass that a sine shakes: dry friction that dither turns into damping, in closed form."""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

from bywire.core import ops
from bywire.core.model import Task
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Duration, Force, Frequency, Mass
from bywire.core.signals import Signal
from systems.describing import Rubbing


class Shaken(NamedTuple):
    """Velocity, and the force of the dither."""

    v: Annotated[float, Signal("m/s", "velocity", 0.03)]
    a: Annotated[float, Signal("N", "dither", 100.0)]


class Driven(NamedTuple):
    """Force held over a sample, the dither's phase, and the rate at which it moves on."""

    u: Annotated[float, Signal("N", "source", 5.0)]
    phase: Annotated[float, Signal("1", "fraction of the dither's period")]
    rate: Annotated[float, Signal("N/s", "rate of the dither", 3e5)]


class DitheredParameters(ParameterSet):
    """A mass on a rough floor under a force and a dither."""

    m: Mass
    F_c: Force
    A: Force
    """amplitude of the dither"""
    f: Frequency
    T_s: Duration


class Dithered(Rubbing):
    """The rubbing mass of ``describing`` with a dither of its own; answers with its velocity."""

    name = "dithered-mass"
    State, Memory = Shaken, Driven

    def tasks(self, par):
        """Return the source: within a sample the dither goes straight to its next value."""

        def tick(x, m, u, p):
            advanced = m.phase + p.f * p.T_s
            phase = advanced - ops.floor(advanced + 1e-9)
            wave = p.A * ops.sin(2.0 * math.pi * phase)
            return Driven(u.u, phase, (wave - x.a) / p.T_s)

        return (Task("source", par.T_s, tick),)

    def mass(self, xe, par):
        """Return the mass."""
        return Shaken(par.m, 1.0)

    def balance(self, x, xe, m, par, contact):
        """Return the force, and the dither's rate."""
        return Shaken(m.u + x.a, m.rate)


def multiplier(par: DitheredParameters) -> float:
    """Return what is left of a deviation in velocity after a period, without mean force.

    Between two reversals nothing acts on it; at each it grows by the ratio of the accelerations.
    Velocity reverses at the phase p of the force with cos p = pi F_c / 2 A.
    """
    crest = crest_of(par) * math.sqrt(1.0 - (0.5 * math.pi * par.F_c / crest_of(par)) ** 2)
    return ((crest - par.F_c) / (crest + par.F_c)) ** 2


def mobility(par: DitheredParameters, F: float) -> float:
    """Return the mean velocity's slope over a mean force F, for F_c far below A.

    The friction's mean is that of a relay with a sine of the amplitude V in its input,
    2 F_c / pi asin(v / V), with V = A / (m w).
    """
    V = crest_of(par) / (2.0 * math.pi * par.f * par.m)
    return 0.5 * math.pi * V / par.F_c * math.cos(0.5 * math.pi * F / par.F_c)


def crest_of(par: DitheredParameters) -> float:
    """Return the amplitude of the fundamental of the sine drawn with straight lines."""
    half = math.pi * par.f * par.T_s
    return par.A * (math.sin(half) / half) ** 2


DITHERED = DitheredParameters(m=1.0, F_c=5.0, A=100.0, f=500.0, T_s=4e-5)
