"""How many threads or processes a piece of work gets: decided here, for all of bywire."""

from __future__ import annotations

import os


def worker_count(workers: int | None = None, most: int | None = None) -> int:
    """Return how many threads or processes compute: one a core, unless the caller says how many.

    Parameters
    ----------
    workers
        How many the caller asks for, >= 1; one a core by default.
    most
        How many of them would find something to do, for instance one for each piece of work.
    """
    count = workers or os.cpu_count() or 1
    return count if most is None else max(1, min(count, most))
