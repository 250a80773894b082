"""Atomic writing of files, and temporary folders that are removed even if a process is killed.

A process locks its folder of temporary files. The next process in the same place removes unlocked
folders, because their processes were killed. On file systems without locks (Windows, some network
drives), it removes folders after a day.
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
"""prefix of the names of temporary folders"""

NULL_CHARACTER = "a path cannot contain a null character"
"""message for a path with a null character, which is the same in every version of Python"""

UNFINISHED = "unfinished"
"""file that marks a folder with an incomplete result"""

_OLD = 86400.0  # seconds; without locks, younger folders may be in use


@contextmanager
def replacing(target: Path) -> Iterator[Path]:
    """Yield the path of a new file, which replaces the target file at the end of the block.

    If the block fails or the process is killed, the target is unchanged. The new file has the same
    name, and is in a hidden folder next to the target.

    Raises
    ------
    OSError
        When the folder is not writable.
    """
    with scratch_folder(target.parent) as folder:
        fresh = folder / target.name
        yield fresh
        os.replace(fresh, target)


def claim(fresh: Path, names: Iterable[Path]) -> Path | None:
    """Rename a complete file to the first free name, even if other processes do the same.

    Parameters
    ----------
    fresh
        The complete file, in a temporary folder on the same file system.
    names
        Paths to try, in order.

    Returns
    -------
    pathlib.Path or None
        The file's new path, or None if all names are taken.

    Raises
    ------
    OSError
        When the folder is not writable.
    """
    for path in names:
        try:
            os.link(fresh, path)
        except FileExistsError:
            continue
        except OSError:  # a file system without links: reserve the name with an empty file
            try:
                os.close(os.open(path, os.O_CREAT | os.O_EXCL | os.O_WRONLY))
            except FileExistsError:
                continue
            os.replace(fresh, path)
        return path
    return None


@contextmanager
def made_folder(folder: Path) -> Iterator[None]:
    """Create a folder with its parents; at the end, remove those that were created and are empty.

    Raises
    ------
    OSError
        When the folder cannot be created.
    """
    missing = [each for each in (folder, *folder.parents) if not os.path.lexists(each)]
    try:
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except ValueError:
            raise OSError(errno.EINVAL, NULL_CHARACTER) from None
        yield
    finally:
        with contextlib.suppress(OSError, ValueError):  # the folder contains a result
            for each in missing:
                each.rmdir()


@contextmanager
def scratch_folder(parent: Path) -> Iterator[Path]:
    """Yield a new folder in another folder, and remove it with its content at the end.

    Raises
    ------
    OSError
        When the folder is not writable.
    """
    sweep(parent)
    folder, lock = _locked(parent)
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)
        _unlock(lock)


def process_folder() -> Path:
    """Return this process's temporary folder, which no other user can read.

    Raises
    ------
    FileError
        When there is no space for temporary files.
    """
    try:
        return _folder_of(os.getpid())
    except OSError as error:
        raise FileError(
            f"bywire cannot create a temporary folder ({error.strerror or error}). Free some disk "
            "space, or set TMPDIR to another folder",
            name="TMPDIR",
        ) from None


@cache
def _folder_of(process: int) -> Path:
    parent = Path(tempfile.gettempdir())
    sweep(parent)
    folder, _ = _locked(parent)  # until the process ends

    def remove() -> None:
        if os.getpid() == process:  # not in forked copies
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
            f"{folder} contains an incomplete result. Rerun the command that wrote it",
            name=str(folder),
        )


def sweep(parent: Path) -> None:
    """Remove the files of killed processes from a folder, as far as possible."""
    with contextlib.suppress(OSError), os.scandir(parent) as entries:
        for each in entries:
            if each.name.startswith(PREFIX) and each.is_dir(follow_symlinks=False):
                _remove_left(Path(each.path))


def _remove_left(folder: Path) -> None:
    try:
        status = folder.stat(follow_symlinks=False)
    except OSError:
        return  # since the listing, its process has ended and removed it
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
    """Return a new folder and its lock, which is None on file systems without locks."""
    while True:
        folder = Path(tempfile.mkdtemp(prefix=PREFIX, dir=parent))
        try:
            lock = _lock(folder)
        except (BlockingIOError, FileNotFoundError):
            continue  # another process is removing it, or has removed it
        except OSError:
            return folder, None
        if folder.exists():
            return folder, lock
        _unlock(lock)


def _lock(folder: Path) -> int | None:
    """Lock a folder until this process ends, even if it is killed."""
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
