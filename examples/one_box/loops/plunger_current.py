"""Current loop of the plunger's motor."""

from __future__ import annotations

from bywire.authoring import Loop, ParameterSet, Point
from one_box.loops.points import CAUSES, PRESSURE, point


def at(par: ParameterSet, value: float) -> Point:
    """Return the brake held at a pressure [Pa]."""
    return point(par, value, "current")


LOOP = Loop(
    name="plunger-current",
    assembly="one-box",
    summary="motor current control at 5 kHz with a free plunger",
    at=PRESSURE,
    inputs=("i_set",),
    output="i",
    cut="duty",
    point=at,
    causes=CAUSES,
    band=(10.0, 1000.0),
    amplitudes=(0.1, 3.0),
    tunables={"ecu.current.k_p": (1e-4, 0.1), "ecu.current.k_i": (0.1, 50.0)},
)
