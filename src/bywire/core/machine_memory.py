"""How much memory the machine has."""

from __future__ import annotations

import os
from functools import cache

_FALLBACK = 8e9  # bytes


@cache
def machine_memory() -> float:
    """Return the machine's memory in bytes; 8 GB where the system does not tell."""
    try:
        return float(os.sysconf("SC_PHYS_PAGES")) * float(os.sysconf("SC_PAGE_SIZE"))
    except (AttributeError, ValueError, OSError):  # not every system has it
        return _FALLBACK
