"""The whole plant of the wedge brake."""

from __future__ import annotations

from bywire.analysis.linear.plant import Plant
from bywire.brakes.wedge.plants.point import AT, whole

PLANT = Plant(
    name="wedge-plant",
    assembly="wedge-brake",
    summary="drives, windings, rotors, brake heart, wedge, caliper, disc, moment sensor",
    at=AT,
    model=whole,
    band=150.0,
)
