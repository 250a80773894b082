"""The folder of an export."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from bywire.core.errors import FileError
from bywire.core.scratch import made_folder


@contextmanager
def export_folder(out: str | Path) -> Iterator[Path]:
    """Yield the folder of an export; what was made of it is removed where nothing is written.

    Raises
    ------
    FileError
        When it cannot be made, or files in it cannot be written.
    """
    folder = Path(out).expanduser()
    try:
        with made_folder(folder):
            yield folder
    except OSError as error:
        raise FileError(
            f"{folder} cannot be written: {error.strerror or error}; make room there, or name "
            "another folder"
        ) from None
