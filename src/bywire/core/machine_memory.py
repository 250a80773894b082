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


def address_space() -> int:
    """Return the bytes of address space that this process may take; 0 where it is not limited."""
    if os.name != "posix":
        return 0
    import resource

    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    return 0 if limit == resource.RLIM_INFINITY else limit
