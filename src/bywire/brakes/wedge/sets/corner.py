"""The wedge brake on the front corner of a mid-size car."""

from __future__ import annotations

from bywire.brakes.wedge.rigs.wedge_corner import WedgeCornerParameters
from bywire.brakes.wedge.sets import roberts2003
from bywire.core.catalog import CitedSet
from bywire.core.provenance import chosen, derived
from bywire.plant.road import SURFACES

_ADHESION = {
    name: derived(value, "dry asphalt for car tyres, as circulated")
    for name, value in SURFACES["dry-asphalt"]._asdict().items()
}

CORNER = CitedSet(
    name="roberts2003-corner",
    assembly="wedge-corner",
    source=roberts2003.SOURCE
    + "; adhesion: values that circulate under the name of M. Burckhardt, 1993; the corner is "
    "chosen",
    summary="the wedge brake on the front corner of a mid-size car",
    parameter_class=WedgeCornerParameters,
    values={
        **roberts2003.ENTRIES[0].values,
        "flywheel.J_F": chosen(1.2, "wheel, tyre and disc of a mid-size car"),
        "corner.body.m": chosen(450.0, "front corner of a mid-size car"),
        "corner.body.g": chosen(9.81, "gravity"),
        "corner.r": chosen(0.30, "rolling radius of a mid-size car's wheel"),
        "corner.tyre.curve": chosen("burckhardt", "its numbers circulate for seven surfaces"),
        "corner.tyre.sigma": chosen(0.20, "a car tyre's, of the order of its contact's length"),
        "corner.tyre.c_t": chosen(1.1, "a tenth of critical damping of a vehicle on stuck tyres"),
        "corner.tyre.v_low": chosen(2.0, "above, the relaxation length damps"),
        "corner.tyre.tau_slide": chosen(1e-4, "short beside all that a vehicle does"),
        "corner.road.grip": chosen(1.0, "as circulated"),
        **{f"corner.road.first.{name}": value for name, value in _ADHESION.items()},
        **{f"corner.road.further.{name}": value for name, value in _ADHESION.items()},
        "corner.road.x_change": chosen(1e4, "beyond any stop: one road, unless told"),
        "corner.road.x_back": chosen(2e4, "behind that"),
        "corner.road.ramp": chosen(0.01, "a jump, next to the length of a tyre's contact"),
        "corner.road.gradient": chosen(0.0, "an experiment's choice"),
        "corner.road.gradient_further": chosen(0.0, "an experiment's choice"),
    },
)
