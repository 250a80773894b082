"""Find the control loops by name."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache

from bywire.analysis import loops
from bywire.analysis.loop import Loop
from bywire.core.discovery import declared, pick


@cache
def all_loops() -> Mapping[str, Loop]:
    """Return every loop: the ``LOOP`` of each module in ``loops``."""
    return declared(loops, "LOOP", Loop)


def find_loop(name: str) -> Loop:
    """Return one loop.

    Raises
    ------
    UnknownNameError
        With the nearest known names.
    """
    return pick(all_loops(), name, "loop")
