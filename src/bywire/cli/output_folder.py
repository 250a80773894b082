"""The folder of ``--out``."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from tempfile import TemporaryFile

from bywire.core.errors import FileError
from bywire.core.scratch import made_folder


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


ANOTHER = "name another one with --out"
"""what to do about a folder that cannot be written"""


@contextmanager
def output_folder(out: Path, advice: str = ANOTHER) -> Iterator[None]:
    """Make the output folder, so that nothing is computed for one that cannot be written.

    What was made for it and is empty in the end is removed. ``advice``: what to do about one that
    cannot be written.

    Raises
    ------
    FileError
        When it cannot be made or written to.
    """
    with ExitStack() as made:
        try:
            made.enter_context(made_folder(out))
            with TemporaryFile(dir=out):
                pass
        except OSError as error:
            raise FileError(
                f"cannot write to the output folder {out}: {error.strerror or error}; {advice}"
            ) from None
        yield
