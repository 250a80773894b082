"""Atomic writing of files, and temporary folders that are removed even after a killed process.

A process locks its folder of temporary files. The next process at the same place removes folders
without a lock, whose process was killed. On file systems without locks (Windows, some network
drives), folders are removed after a day.
"""

from __future__ import annotations

import atexit
import contextlib
import errno
import os
import shutil
import sys
import tempfile
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path

from bywire.core.errors import FileError

if sys.platform != "win32":
    import fcntl

PREFIX = ".bywire-"
"""prefix of temporary folders' names"""

NULL_CHARACTER = "a path cannot hold a null character"
"""message for a path with which Python raises ValueError, independent of its version"""

UNFINISHED = "unfinished"
"""file that marks a folder with an incomplete result"""

_OLD = 86400.0  # seconds; without locks, younger ones may be in use


@contextmanager
def replacing(target: Path) -> Iterator[Path]:
    """Yield a path to write, which replaces the target file at the end of the block.

    If the block fails, or the process is killed, the target is unchanged. The path has the same
    name, in a hidden folder next to the target.

    Raises
    ------
    OSError
        When the folder cannot be written to.
    """
    with scratch_folder(target.parent) as folder:
        fresh = folder / target.name
        yield fresh
        os.replace(fresh, target)


def claim(fresh: Path, names: Iterable[Path]) -> Path | None:
    """Give a written file the first of some names that nothing has yet, whoever else asks for it.

    Parameters
    ----------
    fresh
        The file, in a temporary folder beside the names.
    names
        Where it may go.

    Returns
    -------
    pathlib.Path or None
        Where it is; None where all names are taken.

    Raises
    ------
    OSError
        When the folder cannot be written to.
    """
    for path in names:
        try:
            os.link(fresh, path)
        except FileExistsError:
            continue
        except OSError:  # a file system without links: an empty file holds the name meanwhile
            try:
                os.close(os.open(path, os.O_CREAT | os.O_EXCL | os.O_WRONLY))
            except FileExistsError:
                continue
            os.replace(fresh, path)
        return path
    return None


@contextmanager
def made_folder(folder: Path) -> Iterator[None]:
    """Make a folder with its parents; what was made and is empty in the end is removed.

    Raises
    ------
    OSError
        When it cannot be made.
    """
    missing = [each for each in (folder, *folder.parents) if not os.path.lexists(each)]
    try:
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except ValueError:
            raise OSError(errno.EINVAL, NULL_CHARACTER) from None
        yield
    finally:
        with contextlib.suppress(OSError, ValueError):  # there is a result
            for each in missing:
                each.rmdir()


@contextmanager
def scratch_folder(parent: Path) -> Iterator[Path]:
    """Yield a fresh folder in another, and remove it with all that is in it.

    Raises
    ------
    OSError
        When the folder cannot be written to.
    """
    sweep(parent)
    folder, lock = _locked(parent)
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)
        _unlock(lock)


def process_folder() -> Path:
    """Return the temporary folder of this process, which nobody else can read.

    Raises
    ------
    FileError
        When there is no space for temporary files.
    """
    try:
        return _folder_of(os.getpid())
    except OSError as error:
        raise FileError(
            f"a temporary folder cannot be made ({error.strerror or error}): free some space "
            "there, or set TMPDIR to another folder"
        ) from None


@cache
def _folder_of(process: int) -> Path:
    parent = Path(tempfile.gettempdir())
    sweep(parent)
    folder, _ = _locked(parent)  # until the process ends

    def remove() -> None:
        if os.getpid() == process:  # not in what was forked from it
            shutil.rmtree(folder, ignore_errors=True)

    atexit.register(remove)
    return folder


def require_finished(folder: Path) -> None:
    """Reject a folder with an incomplete result.

    Raises
    ------
    FileError
        When the result is incomplete.
    """
    if (folder / UNFINISHED).exists():
        raise FileError(
            f"{folder} holds a result that is incomplete: run the command that wrote it again",
            name=str(folder),
        )


def sweep(parent: Path) -> None:
    """Remove leftovers of killed processes in a folder, as far as possible."""
    with contextlib.suppress(OSError), os.scandir(parent) as entries:
        for each in entries:
            if each.name.startswith(PREFIX) and each.is_dir(follow_symlinks=False):
                _remove_left(Path(each.path))


def _remove_left(folder: Path) -> None:
    try:
        status = folder.stat(follow_symlinks=False)
    except OSError:
        return  # gone since it was listed: its process has ended in between
    if sys.platform != "win32" and status.st_uid != os.getuid():
        return
    try:
        lock = None if sys.platform == "win32" else _lock(folder)
    except BlockingIOError:
        return  # in use
    except OSError:
        lock = None
    if lock is not None or time.time() - status.st_mtime > _OLD:
        shutil.rmtree(folder, ignore_errors=True)
    _unlock(lock)


def _locked(parent: Path) -> tuple[Path, int | None]:
    """Return a new folder and the holder of its lock; None without locks."""
    while True:
        folder = Path(tempfile.mkdtemp(prefix=PREFIX, dir=parent))
        try:
            lock = _lock(folder)
        except (BlockingIOError, FileNotFoundError):
            continue  # another process is about to remove it, or has done so
        except OSError:
            return folder, None
        if folder.exists():
            return folder, lock
        _unlock(lock)


def _lock(folder: Path) -> int | None:
    """Take the lock of a folder, which a process keeps until it ends, however that is."""
    if sys.platform == "win32":
        return None
    number = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
    try:
        fcntl.flock(number, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(number)
        raise
    return number


def _unlock(lock: int | None) -> None:
    if lock is not None:
        os.close(lock)
