"""State of the source files that affect results, and whether this process runs exactly these files.

Data derived from the files stay valid for later processes until a file changes. Modification times
alone do not reveal every change. A file that is saved after loading, or twice within the clock's
resolution, differs from the running code. A program that uses bywire may also replace bywire's
functions. So only a command certainly runs the code in its files, and only if the files did not
change for a while before it started.
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
"""coarsest resolution [ns] of file systems' modification times"""

_ROOMS = ("bywire.plant", "bywire.control", "bywire.simulation", "bywire.brakes")
_LIBRARIES = ("numpy", "pydantic", "casadi")
"""libraries that a command does not load at its start; code for models loads at least one"""

_started: list[int] = []


@contextmanager
def command() -> Iterator[None]:
    """Mark this process as a command, which runs only code from files until the block ends.

    If code for models is already loaded, another program loaded it and may have changed it. The
    process is then not marked.
    """
    is_shaped = any(name in _LIBRARIES or name.startswith(_ROOMS) for name in sys.modules)
    _started[:] = [] if is_shaped else [time.time_ns()]
    try:
        yield
    finally:
        _started.clear()


@dataclass(frozen=True)
class SourceState:
    """State of the files of bywire and of all brakes.

    Parameters
    ----------
    digest
        Digest that changes if a file is changed, added, moved or removed.
    newest
        Time of the most recent change [ns].
    """

    digest: str
    newest: int

    @property
    def is_running(self) -> bool:
        """Whether this process certainly runs the code in the files."""
        return bool(_started) and self.newest < _started[0] - TICK


def source_state() -> SourceState:
    """Return the state of all files from paths, inode numbers, sizes and modification times."""
    import hashlib

    digest, newest = hashlib.sha256(), 0
    for path in _files():
        digest.update(f"{path}\0".encode(errors="surrogateescape"))
        with suppress(OSError):  # a broken link, or a file that was removed in the meantime
            seen = os.stat(path)
            newest = max(newest, seen.st_mtime_ns, seen.st_ctime_ns)
            line = (seen.st_ino, seen.st_size, seen.st_mtime_ns, seen.st_ctime_ns)
            digest.update(f"{line}\n".encode())
    return SourceState(digest.hexdigest(), newest)


def _files() -> Iterator[str]:
    """Yield all files of any kind, because equations may read tables."""
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
