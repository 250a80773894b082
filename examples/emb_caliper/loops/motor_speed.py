"""Speed loop around the current loop."""

from __future__ import annotations

from dataclasses import replace

from bywire.authoring import Loop, ParameterSet, Point
from emb_caliper.loops.points import CAUSES, FORCE, point


def at(par: ParameterSet, value: float) -> Point:
    """Return the brake held at a clamp force [N] by its speed loop."""
    return point(par, value, "speed")


LOOP = Loop(
    name="motor-speed",
    assembly="emb-caliper",
    summary="speed control at 1 kHz, around current control",
    at=FORCE,
    inputs=("omega_set",),
    output="omega",
    cut="i_ref",
    point=at,
    causes=CAUSES,
    # At higher frequencies the continuous speed responds to the held demand between samples. The
    # linear model is valid only at the samples (0.03 deg off at 60 Hz, 1.2 at 200 Hz).
    band=(0.5, 60.0),
    amplitudes=(0.1, 3.0),
    tunables={"ecu.speed.k_p": (1e-2, 10.0), "ecu.speed.k_i": (0.1, 500.0)},
    proof="slow-strokes",
)
PMSM = replace(
    LOOP,
    name="motor-speed-pmsm",
    assembly="emb-caliper-pmsm",
    # A faster current loop lets the speed respond more between samples (0.007 dB off at 40 Hz).
    band=(0.5, 40.0),
)
