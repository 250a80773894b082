"""Position loop of the plunger around the current loop."""

from __future__ import annotations

from bywire.authoring import Loop, ParameterSet, Point
from one_box.loops.points import CAUSES, PRESSURE, point


def at(par: ParameterSet, value: float) -> Point:
    """Return the brake held at a pressure [Pa]."""
    return point(par, value, "position")


LOOP = Loop(
    name="plunger-position",
    assembly="one-box",
    summary="plunger position control at 2 kHz, around current control",
    at=PRESSURE,
    inputs=("theta_set",),
    output="theta",
    cut="i_ref",
    point=at,
    causes=CAUSES,
    band=(1.0, 200.0),
    amplitudes=(1e-3, 0.03),
    tunables={"ecu.position.f_n": (5.0, 100.0), "ecu.position.zeta": (0.3, 2.0)},
)
