"""Every kernel call ends quickly despite any friction, so that Ctrl-C takes effect."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Annotated, NamedTuple

import numpy as np
import pytest

from bywire.core import ops
from bywire.core.model import Task
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Duration, Force, Length, Mass
from bywire.core.signals import Signal
from bywire.simulation.ensemble import simulate_ensemble, simulate_group
from bywire.simulation.run import Run, simulate
from bywire.simulation.sensitivity import simulate_with_sensitivities
from systems.describing import Held, Recorded, System

H = 20e-6


class Place(NamedTuple):
    """Place of a belt that runs at 1 m/s, and velocity of a body on it."""

    z: Annotated[float, Signal("m", "belt")]
    v: Annotated[float, Signal("m/s", "velocity")]


class RoughParameters(ParameterSet):
    """A body that a force pulls back, on a belt with a smooth part and a rough part."""

    m: Mass
    F: Force
    F_c: Force
    rough: Length
    T_s: Duration


class RoughBelt(System):
    """Friction that acts in the middle of a substep but not at the time of reversal."""

    name = "rough belt"
    State = Place
    frictions = ("v",)

    def tasks(self, par):
        """Return a source that does nothing."""
        return (Task("source", par.T_s, lambda x, m, u, p: Held(u.u)),)

    def mass(self, xe, par):
        """Return the body's mass."""
        return Place(1.0, par.m)

    def balance(self, x, xe, m, par, contact):
        """Return the belt's speed and the force."""
        return Place(1.0, -par.F + 0.0 * x.v)

    def bounds(self, x, xe, m, par, contact):
        """Return the friction of the rough part."""
        held = ops.where(xe.z > par.rough, par.F_c, 0.0)
        return ((-held, held),)

    def output(self, x, m, par, contact, reaction, flow):
        """Return the velocity."""
        return Recorded(x.v, 0.0)


PAR = RoughParameters(m=1.0, F=2.0, F_c=1.0, rough=1.3 * H, T_s=2 * H)
RUN = Run(
    RoughBelt(),
    PAR,
    Place(0.0, PAR.F * 1.1 * H),
    Held(0.0),
    lambda t: np.zeros((len(t), 1)),
    2 * H,
    H,
    2 * H,
)
END = -(PAR.F - PAR.F_c) * 0.9 * H  # it turns a tenth into the second substep, on the smooth part


def ended(function: Callable[[], float]) -> float:
    """Return a function's result within a minute, because a kernel that hangs cannot be stopped."""
    values: list[float] = []
    thread = threading.Thread(target=lambda: values.append(function()), daemon=True)
    thread.start()
    thread.join(60.0)
    assert values, "it did not end"
    return values[0]


@pytest.mark.parametrize(
    "velocity",
    [
        lambda: simulate(RUN, engine="compiled")["y"][-1],
        lambda: simulate(RUN, engine="virtual-machine")["y"][-1],
        lambda: simulate_group([RUN] * 3).values[0, 2, -1],
        lambda: simulate_ensemble(RUN, {"F": np.full(3, PAR.F)}, ["y"])["y"][1, -1],
        lambda: simulate_with_sensitivities(RUN, ["F_c"], ["y"]).trajectory["y"][-1],
    ],
    ids=["single", "virtual machine", "group", "ensemble", "tangents"],
)
def test_a_turn_ends_where_friction_does_not_jump(velocity: Callable[[], float]) -> None:
    assert ended(velocity) == pytest.approx(END, rel=1e-9)
