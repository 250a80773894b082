"""Current loop of the synchronous motor, along its q axis."""

from __future__ import annotations

from bywire.authoring import Loop, ParameterSet, Point
from emb_caliper.loops.points import CAUSES, FORCE, point


def at(par: ParameterSet, value: float) -> Point:
    """Return the brake held at a clamp force [N] by its current."""
    return point(par, value, "current", 10e-6)


LOOP = Loop(
    name="q-current",
    assembly="emb-caliper-pmsm",
    summary="field-oriented current control at 10 kHz with a free rotor",
    at=FORCE,
    inputs=("i_set",),
    output="i_q",
    cut="i_q",
    point=at,
    causes=CAUSES,
    band=(10.0, 2000.0),
    amplitudes=(1e-2, 1.0),
    tunables={"ecu.current.omega_c": (100.0, 1e4)},
)
