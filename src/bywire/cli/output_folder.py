"""The folder of ``--out``."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryFile

from bywire.core.errors import FileError


def require_folder(out: Path) -> None:
    """Make the output folder, so that nothing is computed for one that cannot be written.

    Raises
    ------
    FileError
        When it cannot be made or written to.
    """
    try:
        out.mkdir(parents=True, exist_ok=True)
        with TemporaryFile(dir=out):
            pass
    except (OSError, ValueError) as error:  # ValueError: a null character in the path
        reason = getattr(error, "strerror", None) or str(error)
        raise FileError(
            f"cannot write to the output folder {out}: {reason}; name another one with --out"
        ) from None
