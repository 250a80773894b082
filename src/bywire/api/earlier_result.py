"""What an earlier identification or study left in the folder of ``--out``."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from bywire.core.callers import option
from bywire.core.errors import FileError

ESTIMATE = "estimate.json"
"""file of the output folder that says which method wrote it, and what else it wrote"""

STUDY = "study.json"
"""file of the output folder that says which method a study tried, and what came of it"""

_OURS = (".html", ".nc", ".png", ".toml")


def require_own(out: Path, method: str) -> None:
    """Refuse a folder that holds a result or a study of another method.

    Raises
    ------
    FileError
        When it does, or what it holds cannot be read.
    """
    for path, what in ((out / ESTIMATE, "result"), (out / STUDY, "study")):
        earlier = _read(path)
        if earlier is None or earlier.get("method") == method:
            continue
        raise FileError(
            f"{out} holds a {what} of {earlier.get('method') or 'something else'}: name another "
            f"folder with {option('folder')} for {method}, or remove {path} with what belongs to it"
        )


def remove_study(out: Path) -> None:
    """Remove the result of an earlier study; the experiments that it finished stay.

    Raises
    ------
    FileError
        When it cannot be removed.
    """
    _unlink(out / STUDY)


def remove(out: Path, keep: Sequence[Path]) -> None:
    """Remove the files of an earlier result, so that none stands beside the new one.

    Parameters
    ----------
    out
        Folder.
    keep
        Files that stay: what is just being identified.

    Raises
    ------
    FileError
        When one cannot be removed.
    """
    earlier = _read(out / ESTIMATE)
    if earlier is None:
        return
    kept = {path.resolve() for path in keep}
    # Names alone, within the folder: it may have moved since. The list itself goes last.
    names = [Path(str(text)).name for text in earlier.get("files", [])]
    written = [out / name for name in names if Path(name).suffix in _OURS]
    for path in (*written, out / ESTIMATE):
        if path.resolve() not in kept:
            _unlink(path)


def _unlink(path: Path) -> None:
    try:
        if path.is_file():
            path.unlink()
    except OSError as error:
        raise FileError(
            f"cannot remove {path} of an earlier result: {error.strerror}; name another folder "
            f"with {option('folder')}"
        ) from None


def _read(path: Path) -> dict[str, Any] | None:
    """Return an earlier result, None where there is none."""
    if not path.exists():
        return None
    try:
        earlier = json.loads(path.read_text(encoding="utf-8"))
        if not (isinstance(earlier, dict) and isinstance(earlier.get("files", []), list)):
            raise ValueError("it is no result of bywire identify")
    except (OSError, ValueError) as error:
        raise FileError(
            f"{path} cannot be read ({error}): name another folder with {option('folder')}, or "
            "remove it"
        ) from None
    return earlier
