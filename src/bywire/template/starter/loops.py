"""Control loops of the brake starter, for ``bywire margins``, ``design`` and similar commands."""

from __future__ import annotations

from typing import cast

from bywire.authoring import Loop, ParameterSet, Point, Quantity
from bywire.template.starter.model import StarterActuator, Stimulus
from bywire.template.starter.parameters import Parameters
from bywire.template.starter.point import at_force


def point(par: ParameterSet, value: float) -> Point:
    """Return the brake in equilibrium at a clamp force [N]."""
    state, memory = at_force(value, cast(Parameters, par))
    return Point(StarterActuator(), par, state, memory, Stimulus(F_set=value))


LOOP = Loop(
    name="starter-force",
    assembly="starter-actuator",
    summary="clamp force control around speed control, 1 kHz",
    at=Quantity("force", "N", 10e3),
    inputs=("F_set",),
    output="F",
    cut="v",
    point=point,
    causes={"dry friction": {"spindle.T_0": 0.0, "spindle.c_F": 0.0}},
    band=(0.1, 100.0),
    amplitudes=(100.0, 1000.0),
    tunables={
        "control.k_F": (1e-3, 0.5),
        "control.k_p": (1e-3, 1.0),
        "control.k_i": (1e-2, 100.0),
    },
    proof="starter-clamp",
)
