"""Resources of a server from its start to its end."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from bywire.core.scratch import scratch_folder
from bywire.server.guard import new_token
from bywire.server.jobs import Jobs
from bywire.server.live_pages import LivePages
from bywire.server.place import Place

LARGEST_FILE = 1_000_000_000
"""maximum size of an uploaded measurement, in bytes"""


@dataclass(frozen=True)
class Service:
    """Served folder.

    Parameters
    ----------
    place, jobs, live_pages
        The folder, its jobs, and its live pages.
    largest
        Maximum size of an uploaded measurement, in bytes.
    token
        Token of the link.
    reading
        Lock for reading a bench in the server's process, because registries are not thread-safe.
    plotting
        Lock for reading a measurement for a first plot, because several plots need too much memory.
    """

    place: Place
    jobs: Jobs
    live_pages: LivePages
    largest: int = LARGEST_FILE
    token: str = field(default_factory=new_token)
    reading: threading.Lock = field(default_factory=threading.Lock)
    plotting: threading.Lock = field(default_factory=threading.Lock)


@contextmanager
def service_of(place: Place, scratch_parent: Path, largest: int) -> Iterator[Service]:
    """Yield the resources of a server. Its jobs and temporary files end with the block.

    Raises
    ------
    OSError
        If the folder is not writable.
    """
    with scratch_folder(scratch_parent) as scratch:
        jobs = Jobs(place)
        try:
            yield Service(place, jobs, LivePages(place, jobs, scratch), largest)
        finally:
            jobs.close()
