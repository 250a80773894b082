"""What a server works with from its start to its end."""

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
"""bytes of a measurement that is dropped on a page"""


@dataclass(frozen=True)
class Service:
    """A folder that is served.

    Parameters
    ----------
    place, jobs, live_pages
        The folder, what is computed, and its live pages.
    largest
        Bytes of a measurement that is dropped.
    token
        What the link has.
    reading
        Held while a bench is read in the server's own process: registries know no threads.
    """

    place: Place
    jobs: Jobs
    live_pages: LivePages
    largest: int = LARGEST_FILE
    token: str = field(default_factory=new_token)
    reading: threading.Lock = field(default_factory=threading.Lock)


@contextmanager
def service_of(place: Place, scratch_parent: Path, largest: int) -> Iterator[Service]:
    """Yield what a server works with; its jobs and temporary files end with the block.

    Raises
    ------
    OSError
        When the folder cannot be written to.
    """
    with scratch_folder(scratch_parent) as scratch:
        jobs = Jobs(place)
        try:
            yield Service(place, jobs, LivePages(place, jobs, scratch), largest)
        finally:
            jobs.close()
