"""Force loop around the speed and current loops."""

from __future__ import annotations

from bywire.authoring import Loop, ParameterSet, Point
from emb_caliper.loops.points import CAUSES, FORCE, point


def at(par: ParameterSet, value: float) -> Point:
    """Return the brake in equilibrium at a clamp force [N]."""
    return point(par, value, "force")


LOOP = Loop(
    name="clamp-force",
    assembly="emb-caliper",
    variants=("emb-caliper-pmsm",),
    summary="force control at 1 kHz, around speed and current control",
    at=FORCE,
    inputs=("F_set",),
    output="F_cl",
    cut="omega_ref",
    point=at,
    causes=CAUSES,
    band=(0.5, 50.0),
    amplitudes=(100.0, 1e3, 3e3),
    tunables={"ecu.force.k_p": (1e-3, 1.0), "ecu.force.k_i": (1e-4, 1.0)},
    proof="clamp-step",
)
