"""Find the reproduced sources by name."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Mapping
from functools import cache

from bywire import reproduction
from bywire.core.errors import unknown_name
from bywire.reproduction.reproduction import Source


@cache
def sources() -> Mapping[str, Source]:
    """Return every source: the ``SOURCE`` of each module in this folder."""
    found: dict[str, Source] = {}
    for module in pkgutil.iter_modules(reproduction.__path__):
        loaded = importlib.import_module(f"{reproduction.__name__}.{module.name}")
        source = getattr(loaded, "SOURCE", None)
        if isinstance(source, Source):
            found[source.name] = source
    return found


def find_source(name: str) -> Source:
    """Return one source.

    Raises
    ------
    UnknownNameError
        With the nearest known names.
    """
    known = sources()
    if name not in known:
        raise unknown_name("source", name, known)
    return known[name]
