"""Folder of compiled kernels: code that is run, so only what nobody else could have put there.

A file is run only if it, its folder and every folder above belong to the user or to root, and
nobody else may write to them; of the folders above, one like ``/tmp`` will do, where others cannot
replace what is not theirs. Digests tell damage, not intent: who can write a library can write its
digest. On Windows rights are not modes, and the user's folders are taken as they are.
"""

from __future__ import annotations

import contextlib
import ctypes
import hashlib
import os
import stat
import struct
import sys
import warnings
from functools import cache
from pathlib import Path

from platformdirs import user_cache_path

from bywire.core.errors import CompilerError
from bywire.core.scratch import process_folder, replacing, scratch_folder

if sys.platform != "win32":
    import grp
    import pwd


def cache_folder() -> Path:
    """Return the folder of compiled kernels (``BYWIRE_CACHE`` moves it)."""
    moved = os.environ.get("BYWIRE_CACHE")
    return Path(moved) if moved else user_cache_path("bywire", "bywire") / "kernels"


def usable_folder() -> Path:
    """Return a folder for kernels that exists, can be written, and is the user's alone.

    The cache folder, else a fresh temporary one for this process.

    Raises
    ------
    CompilerError
        When ``BYWIRE_CACHE`` names a folder that others may write to, or a relative one.
    """
    folder = cache_folder()
    if not folder.is_absolute():  # in whatever folder one works, somebody else's perhaps
        if "BYWIRE_CACHE" in os.environ:
            raise CompilerError(
                f"BYWIRE_CACHE = {folder} is relative, and kernels of the working folder would be "
                f"run: name a folder from the root, such as {folder.absolute()}, or unset it"
            )
        return process_folder()
    try:
        for each in reversed((folder, *folder.parents)):  # each, or those above get other rights
            each.mkdir(mode=0o700, exist_ok=True)
        with scratch_folder(folder):
            pass
    except OSError:
        return process_folder()
    place = open_to_others(folder)
    if not place:
        return folder
    advice = f"{place} is not yours alone, and others could put code there"
    if "BYWIRE_CACHE" in os.environ:
        raise CompilerError(
            f"BYWIRE_CACHE = {folder}: {advice}: name a new folder in one that only you can write "
            "to, or unset it"
        )
    _warn_once(f"compiled kernels are not kept: {advice}: set BYWIRE_CACHE to a folder of yours")
    return process_folder()


@cache
def _warn_once(text: str) -> None:
    warnings.warn(text, stacklevel=3)


def open_to_others(path: Path) -> str:
    """Return what others may write to of a file or folder and the folders above; else nothing.

    Raises
    ------
    OSError
        When it is not there.
    """
    if sys.platform == "win32":
        return ""
    resolved = path.resolve(strict=True)
    is_folder = resolved.is_dir()
    for steps, each in enumerate((resolved, *resolved.parents)):
        status = each.stat(follow_symlinks=False)
        is_above = steps > (0 if is_folder else 1)
        if status.st_uid not in (os.getuid(), 0) or not _is_closed(status, is_above):
            return str(each)
    return ""


def _is_closed(status: os.stat_result, is_above: bool) -> bool:
    """Return whether nobody but its owner may write to something."""
    by_others = status.st_mode & stat.S_IWOTH
    by_group = status.st_mode & stat.S_IWGRP and not _is_private(status.st_gid)
    return not (by_others or by_group) or bool(is_above and status.st_mode & stat.S_ISVTX)


def _is_private(group: int) -> bool:
    """Return whether a group is a user's own, as many systems make one for each."""
    if sys.platform == "win32":
        return True
    try:
        entry, user = grp.getgrgid(group), pwd.getpwuid(os.getuid())
    except KeyError:
        return False
    is_personal = user.pw_gid == group and entry.gr_name == user.pw_name
    return is_personal and set(entry.gr_mem) <= {user.pw_name}


def keep_text(path: Path, text: str) -> None:
    """Write a file of the folder whole or not at all; where that fails, nothing is kept."""
    with contextlib.suppress(OSError), replacing(path) as fresh:
        fresh.write_text(text, encoding="utf-8")


def is_intact(library: Path, entry: str) -> bool:
    """Return whether a library is the user's, has a function, and is what its digest was made of.

    Parameters
    ----------
    entry
        Name of the function; any library will do without.
    """
    try:
        content = _content(library)
        digest = _content(digest_of(library)).decode()
    except (OSError, ValueError):  # missing, of somebody else, or no text at all
        return False
    is_same = hashlib.sha256(content).hexdigest() == digest
    return is_same and _is_whole(content) and f"{entry}\0".encode() in content


def digest_of(library: Path) -> Path:
    """Return the file with the digest of a library."""
    return library.with_suffix(".sha256")


def _content(path: Path) -> bytes:
    """Return the bytes of a file that nobody else could have written."""
    place = open_to_others(path)
    if place:
        raise PermissionError(place)
    return path.read_bytes()


def _is_whole(content: bytes) -> bool:
    """Return whether a library is as long as its header says: the system would crash on others."""
    if content[:4] != b"\x7fELF":
        return len(content) > 4  # of another system
    if len(content) < 64 or content[4] != 2:
        return False
    (table,) = struct.unpack_from("=Q", content, 40)
    size, count = struct.unpack_from("=HH", content, 58)
    return bool(table) and len(content) >= table + size * count


def load(library: Path, entry: str) -> ctypes.CDLL:
    """Load a library; whose it is, is looked at once more.

    Nobody but the user and root can then put another in its place in between.

    Raises
    ------
    CompilerError
        When it is not the user's alone, or cannot be loaded.
    """
    try:
        place = open_to_others(library)
        if place:
            raise CompilerError(
                f"{library} is not loaded: {place} is not yours alone, and others could put code "
                "there: set BYWIRE_CACHE to a new folder in one that only you can write to"
            )
        loaded = ctypes.CDLL(str(library.resolve(strict=True)))
        getattr(loaded, entry)
    except (OSError, AttributeError) as error:
        raise CompilerError(f"{library} cannot be loaded ({error}): delete it") from None
    return loaded


def sha256(path: Path) -> str:
    """Return the digest of a file."""
    return hashlib.sha256(path.read_bytes()).hexdigest()
