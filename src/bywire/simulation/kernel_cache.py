"""Folder of compiled kernels: loaded code, so only folders that nobody else can write to."""

from __future__ import annotations

import contextlib
import hashlib
import os
import stat
import tempfile
from functools import cache
from pathlib import Path

from platformdirs import user_cache_path

from bywire.core.errors import CompilerError


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
        When ``BYWIRE_CACHE`` names a folder that others may write to.
    """
    folder = cache_folder()
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError:
        return _own_scratch()
    if not _private(folder):
        if "BYWIRE_CACHE" in os.environ:
            raise CompilerError(
                f"BYWIRE_CACHE = {folder} can be written by others, who could put code there: "
                "name a folder of your own (chmod go-w)"
            )
        return _own_scratch()
    return folder


@cache
def _own_scratch() -> Path:
    return Path(tempfile.mkdtemp(prefix="bywire-"))


def _private(folder: Path) -> bool:
    """Return whether a folder belongs to the user and nobody else may write to it."""
    if os.name == "nt":
        return True  # rights are not modes there
    found = folder.stat()
    own = found.st_uid == os.getuid()
    return own and not found.st_mode & (stat.S_IWGRP | stat.S_IWOTH)


def keep_text(path: Path, text: str) -> None:
    """Write a file of the folder whole or not at all; where that fails, nothing is kept."""
    with contextlib.suppress(OSError):
        number, name = tempfile.mkstemp(dir=path.parent)
        partial = Path(name)
        try:
            with open(number, "w", encoding="utf-8") as stream:
                stream.write(text)
            os.replace(partial, path)
        finally:
            partial.unlink(missing_ok=True)


def intact(library: Path, digest: Path) -> bool:
    """Return whether a library is the one that its digest was made of."""
    try:
        return sha256(library) == digest.read_text()
    except (OSError, ValueError):  # missing, or no text at all
        return False


def sha256(path: Path) -> str:
    """Return the digest of a file."""
    return hashlib.sha256(path.read_bytes()).hexdigest()
