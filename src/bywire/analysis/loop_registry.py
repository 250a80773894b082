"""Find the control loops by name."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Mapping
from functools import cache

from bywire.analysis import loops
from bywire.analysis.loop import Loop
from bywire.core.errors import unknown_name


@cache
def all_loops() -> Mapping[str, Loop]:
    """Return every loop: the ``LOOP`` of each module in ``loops``."""
    found: dict[str, Loop] = {}
    for module in pkgutil.iter_modules(loops.__path__):
        loaded = importlib.import_module(f"{loops.__name__}.{module.name}")
        loop = getattr(loaded, "LOOP", None)
        if loop is not None:
            found[loop.name] = loop
    return found


def find_loop(name: str) -> Loop:
    """Return one loop.

    Raises
    ------
    UnknownNameError
        With the nearest known names.
    """
    known = all_loops()
    if name not in known:
        raise unknown_name("loop", name, known)
    return known[name]
