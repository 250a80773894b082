"""Parameter sets of a sport motorcycle with its rider, and sets derived from it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from bywire.brakes.motorcycle.sets import dardanelli2010
from bywire.brakes.two_wheeler.parameters import TwoWheelerParameters, WholeRearParameters
from bywire.brakes.two_wheeler.rigs.wheel_on_drum import WheelOnDrumParameters
from bywire.core.catalog import CitedSet, Formula, chosen, derived
from bywire.plant.road import SURFACES
from bywire.reproduction.source_file import SourceFile

_DRY = {
    name: derived(value, "dry asphalt for car tires, commonly published values")
    for name, value in SURFACES["dry-asphalt"]._asdict().items()
}


def _gain(disc: Any) -> float:
    """Return a brake's torque per pressure."""
    gain: float = disc.faces * disc.mu_pad * disc.A_cal * disc.r_eff
    return gain


def _lift(par: Any) -> float:
    """Return the deceleration at which lift control acts, just below the lift limit."""
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


# --- The front wheel alone

_FROM = {
    "wheel": "vehicle.front_wheel",
    "tyre": "vehicle.front_tyre",
    "brake.circuit": "front.circuit",
    "brake.disc": "front.disc",
    "slip": "ecu.front_slip",
}

_PLACES = {there: here for here, there in _FROM.items()}

FRONT600 = CitedSet(
    name="front600",
    assembly="wheel-on-drum",
    source=FILE.citation,
    summary="front wheel of the sport motorcycle on a wet drum",
    parameter_class=WheelOnDrumParameters,
    values={
        **{
            name.replace(there, here, 1): value.moved_to(_PLACES)
            for here, there in _FROM.items()
            for name, value in SPORT600.values.items()
            if name.startswith(f"{there}.")
        },
        "drum.v": chosen(20.0, "speed in the middle of a stop"),
        "drum.N": chosen(2200.0, "front wheel load during a full stop on wet asphalt"),
        **{
            f"drum.surface.{name}": derived(
                value, "wet asphalt for car tires, commonly published values"
            )
            for name, value in SURFACES["wet-asphalt"]._asdict().items()
        },
        "T_s": SPORT600.values["ecu.T_s"],
    },
)


# --- The whole brake of Dardanelli et al. (2010) at the rear wheel

_BRAKE = next(e for e in dardanelli2010.ENTRIES if e.name == "dardanelli2010-retuned")

WHOLE_REAR = CitedSet(
    name="sport600-whole-rear",
    assembly="two-wheeler-whole-rear",
    source=f"{FILE.citation}; the whole rear brake: {dardanelli2010.FILE.citation}",
    summary="the sport motorcycle with the rear brake from dardanelli2010-retuned",
    parameter_class=WholeRearParameters,
    values={
        **{
            name: value
            for name, value in SPORT600.values.items()
            if not name.startswith("rear.circuit.")
        },
        **{
            f"rear.actuator.{name}": value.moved_to({"": "rear.actuator"})
            for name, value in _BRAKE.values.items()
        },
    },
)
