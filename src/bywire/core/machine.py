"""The machine's memory, and the number of threads or processes for a piece of work."""

from __future__ import annotations

import os
from functools import cache

_FALLBACK = 8e9  # bytes


@cache
def machine_memory() -> float:
    """Return the machine's memory in bytes; 8 GB if the system does not report it."""
    try:
        return float(os.sysconf("SC_PHYS_PAGES")) * float(os.sysconf("SC_PAGE_SIZE"))
    except (AttributeError, ValueError, OSError):  # not every system reports it
        return _FALLBACK


def address_space() -> int:
    """Return the limit of this process's address space in bytes; 0 if there is no limit."""
    if os.name != "posix":
        return 0
    import resource

    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    return 0 if limit == resource.RLIM_INFINITY else limit


def worker_count(workers: int | None = None, most: int | None = None) -> int:
    """Return the number of threads or processes for a piece of work.

    Parameters
    ----------
    workers
        Number that the caller requests, >= 1. Default: one per core.
    most
        Maximum useful number, such as one per case.
    """
    count = workers or os.cpu_count() or 1
    return count if most is None else max(1, min(count, most))
