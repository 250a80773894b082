"""State of the source files that affect results, and whether this process runs exactly them.

What was made of them can be kept for a later process as long as they stay as they are. Times of
change tell that only with care: a file that is saved after it was loaded, or twice within the
clock's tick, differs from what runs. And a program that uses bywire may put functions of its own in
the place of ours. So only a command is sure to run what its files say, and only files that were
left alone for a while before it started.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

import bywire.core

TICK = 2_000_000_000
"""coarsest resolution [ns] of the times that file systems keep"""

_ROOMS = ("bywire.plant", "bywire.control", "bywire.simulation", "bywire.brakes")
_LIBRARIES = ("numpy", "pydantic", "casadi")
"""libraries of which code that shapes models loads at least one, and the start of a command none"""

_started: list[int] = []


@contextmanager
def command() -> Iterator[None]:
    """Mark a command: a process in which, until the block ends, nothing but files' code runs.

    Where code that shapes models is loaded already, somebody else did so before and may have
    changed it: then nothing is marked.
    """
    is_shaped = any(name in _LIBRARIES or name.startswith(_ROOMS) for name in sys.modules)
    _started[:] = [] if is_shaped else [time.time_ns()]
    try:
        yield
    finally:
        _started.clear()


@dataclass(frozen=True)
class SourceState:
    """State of bywire's files and of every brake's.

    Parameters
    ----------
    digest
        What changes when a file is changed, added, moved or taken away.
    newest
        Time of the latest change [ns].
    """

    digest: str
    newest: int

    @property
    def is_running(self) -> bool:
        """Whether this process certainly runs the code in the files."""
        return bool(_started) and self.newest < _started[0] - TICK


def source_state() -> SourceState:
    """Return the state of all files by path, number, size and times of change."""
    import hashlib

    digest, newest = hashlib.sha256(), 0
    for path in _files():
        digest.update(f"{path}\0".encode(errors="surrogateescape"))
        with suppress(OSError):  # a link to nowhere, or gone by now
            seen = os.stat(path)
            newest = max(newest, seen.st_mtime_ns, seen.st_ctime_ns)
            line = (seen.st_ino, seen.st_size, seen.st_mtime_ns, seen.st_ctime_ns)
            digest.update(f"{line}\n".encode())
    return SourceState(digest.hexdigest(), newest)


def _files() -> Iterator[str]:
    """Yield every file, whatever its kind: equations may come with tables."""
    from bywire.core.brake import brakes

    package = Path(bywire.core.__file__ or "").parents[1]
    yield from _below(str(package))
    for brake in brakes().values():
        file = Path(brake.file)
        if not file.is_relative_to(package):
            yield from _below(str(file.parent)) if file.name == "__init__.py" else (str(file),)


def _below(folder: str) -> Iterator[str]:
    listed: list[os.DirEntry[str]] = []
    with suppress(OSError), os.scandir(folder) as entries:
        listed = sorted(entries, key=lambda entry: entry.name)
    for entry in listed:
        if entry.name == "__pycache__" or entry.name.startswith("."):
            continue
        if entry.is_dir(follow_symlinks=False):
            yield from _below(entry.path)
        else:
            yield entry.path
