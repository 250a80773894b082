"""Find the plants by name."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache

from bywire.analysis import plants
from bywire.analysis.linear.plant import Plant
from bywire.core.discovery import declared, pick


@cache
def all_plants() -> Mapping[str, Plant]:
    """Return every plant: the ``PLANT`` of each module in ``plants``."""
    return declared(plants, "PLANT", Plant)


def find_plant(name: str) -> Plant:
    """Return one plant.

    Raises
    ------
    UnknownNameError
        With the nearest known names.
    """
    return pick(all_plants(), name, "plant")
