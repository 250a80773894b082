"""The folder of ``--out``."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryFile

from bywire.core.errors import FileError


def folder(text: str) -> Path:
    """Return the path that ``--out`` names; nothing is no path, and never the current folder.

    Raises
    ------
    FileError
        When it names nothing.
    """
    if not text.strip():
        raise FileError("--out '': name a folder; '.' is the one that you are in")
    return Path(text)


@contextmanager
def output_folder(out: Path) -> Iterator[None]:
    """Make the output folder, so that nothing is computed for one that cannot be written.

    What was made for it and is empty in the end is removed.

    Raises
    ------
    FileError
        When it cannot be made or written to.
    """
    missing = [each for each in (out, *out.parents) if not os.path.lexists(each)]
    try:
        out.mkdir(parents=True, exist_ok=True)
        with TemporaryFile(dir=out):
            pass
    except (OSError, ValueError) as error:  # ValueError: a null character in the path
        reason = getattr(error, "strerror", None) or str(error)
        raise FileError(
            f"cannot write to the output folder {out}: {reason}; name another one with --out"
        ) from None
    try:
        yield
    finally:
        with suppress(OSError):  # there is a result
            for each in missing:
                each.rmdir()
