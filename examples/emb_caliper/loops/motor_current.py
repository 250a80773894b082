"""Motor current loop."""

from __future__ import annotations

from bywire.authoring import Loop, ParameterSet, Point
from emb_caliper.loops.points import CAUSES, FORCE, point


def at(par: ParameterSet, value: float) -> Point:
    """Return the brake held at a clamp force [N] by its current."""
    return point(par, value, "current", 10e-6)


LOOP = Loop(
    name="motor-current",
    assembly="emb-caliper",
    summary="current control at 5 kHz with a free rotor",
    at=FORCE,
    inputs=("i_set",),
    output="i",
    cut="duty",
    point=at,
    causes=CAUSES,
    band=(5.0, 1000.0),
    amplitudes=(1e-2, 1.0),
    tunables={"ecu.current.k_p": (1e-3, 1.0), "ecu.current.k_i": (0.1, 500.0)},
)
