"""A sport motorcycle with its rider: values by formula; all others are in the TOML file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from bywire.brakes.two_wheeler.parameters import TwoWheelerParameters
from bywire.core.catalog import Formula, derived
from bywire.plant.road import SURFACES
from bywire.reproduction.source_file import SourceFile

_DRY = {
    name: derived(value, "dry asphalt for car tyres, as circulated")
    for name, value in SURFACES["dry-asphalt"]._asdict().items()
}


def _gain(disc: Any) -> float:
    """Return the torque over the pressure of a brake."""
    gain: float = disc.faces * disc.mu_pad * disc.A_cal * disc.r_eff
    return gain


def _lift(par: Any) -> float:
    """Return the deceleration at which lift control acts, just below that of lifting."""
    body = par.vehicle.body
    limit: float = 0.95 * body.g * body.l_f / body.h
    return limit


_FORMULAS: dict[str, Formula] = {
    "front_gain": lambda par: _gain(par.front.disc),
    "rear_gain": lambda par: _gain(par.rear.disc),
    "lift": _lift,
}

FILE = SourceFile(Path(__file__).with_suffix(".toml"))
(SPORT600,) = FILE.sets(TwoWheelerParameters, FILE.values(_FORMULAS, {"dry_asphalt": _DRY}))
