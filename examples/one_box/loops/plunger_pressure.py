"""Pressure loop around the position and current loops."""

from __future__ import annotations

from bywire.authoring import Loop, ParameterSet, Point
from one_box.loops.points import CAUSES, PRESSURE, point


def at(par: ParameterSet, value: float) -> Point:
    """Return the brake held at a pressure [Pa]."""
    return point(par, value, "pressure")


LOOP = Loop(
    name="plunger-pressure",
    assembly="one-box",
    summary="plunger pressure control at 1 kHz, around position and current control",
    at=PRESSURE,
    inputs=("p_set",),
    output="p_mc",
    cut="omega_ref",
    point=at,
    causes=CAUSES,
    band=(0.5, 60.0),
    amplitudes=(1e4, 1e5, 5e5),
    tunables={"ecu.pressure.omega_c": (5.0, 300.0)},
)
