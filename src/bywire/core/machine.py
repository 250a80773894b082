"""The machine: its memory, and how many threads or processes a piece of work gets."""

from __future__ import annotations

import os
from functools import cache

_FALLBACK = 8e9  # bytes


@cache
def machine_memory() -> float:
    """Return the machine's memory in bytes; 8 GB where the system does not state it."""
    try:
        return float(os.sysconf("SC_PHYS_PAGES")) * float(os.sysconf("SC_PAGE_SIZE"))
    except (AttributeError, ValueError, OSError):  # not every system states it
        return _FALLBACK


def address_space() -> int:
    """Return the bytes of address space that this process may take; 0 where it is not limited."""
    if os.name != "posix":
        return 0
    import resource

    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    return 0 if limit == resource.RLIM_INFINITY else limit


def worker_count(workers: int | None = None, most: int | None = None) -> int:
    """Return the number of threads or processes of a piece of work, for all of bywire.

    Parameters
    ----------
    workers
        Number that the caller asks for, >= 1; one per core by default.
    most
        Largest number that has something to do, for instance one for each case.
    """
    count = workers or os.cpu_count() or 1
    return count if most is None else max(1, min(count, most))
