"""The front wheel of the sport motorcycle alone, loaded as in a stop on wet asphalt."""

from __future__ import annotations

from bywire.brakes.two_wheeler.rigs.wheel_on_drum import WheelOnDrumParameters
from bywire.brakes.two_wheeler.sets import sport600
from bywire.core.catalog import CitedSet, chosen, derived
from bywire.plant.road import SURFACES

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
    source=sport600.FILE.citation,
    summary="front wheel of the sport motorcycle on a wet drum",
    parameter_class=WheelOnDrumParameters,
    values={
        **{
            name.replace(there, here, 1): value.moved_to(_PLACES)
            for here, there in _FROM.items()
            for name, value in sport600.SPORT600.values.items()
            if name.startswith(f"{there}.")
        },
        "drum.v": chosen(20.0, "the middle of a stop"),
        "drum.N": chosen(2200.0, "the front wheel's load in a full stop on wet asphalt"),
        **{
            f"drum.surface.{name}": derived(value, "wet asphalt for car tyres, as circulated")
            for name, value in SURFACES["wet-asphalt"]._asdict().items()
        },
        "T_s": sport600.SPORT600.values["ecu.T_s"],
    },
)
