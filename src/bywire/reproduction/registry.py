"""Find the reproduced sources by name."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache

from bywire import reproduction
from bywire.core.discovery import declared, pick
from bywire.reproduction.reproduction import Source


@cache
def sources() -> Mapping[str, Source]:
    """Return every source: the ``SOURCE`` of each module in this folder."""
    return declared(reproduction, "SOURCE", Source)


def find_source(name: str) -> Source:
    """Return one source.

    Raises
    ------
    UnknownNameError
        With the nearest known names.
    """
    return pick(sources(), name, "source")
