"""Sizes that a file declares, held against what it can hold, before memory is asked for."""

from __future__ import annotations

from pathlib import Path

from bywire.core.errors import FileError

DEFLATE = 1032
"""how many bytes one byte of a deflate stream can become at most"""

_SLACK = 1 << 16  # bytes: headers, and small pieces that compress better


def require_possible(path: Path, what: str, declared: int, stored: int) -> None:
    """Refuse a declared size that the stored bytes cannot hold, compressed or not.

    Parameters
    ----------
    path
        What errors call the file.
    what
        Which piece of it.
    declared
        Bytes that it says it has.
    stored
        Bytes that are there for it.

    Raises
    ------
    FileError
        When the size is not possible.
    """
    if declared > DEFLATE * stored + _SLACK:
        raise FileError(
            f"{path}: {what} says that it has {declared} bytes, but only {stored} are stored for "
            "it: the file is damaged or was made to exhaust memory"
        )
