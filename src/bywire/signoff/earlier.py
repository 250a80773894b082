"""Earlier sign-off, with which a document compares the current one."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any
from warnings import warn

from bywire.cases.store import json_object
from bywire.core.errors import FileError

RECORD = "signoff.json"
"""record of a sign-off in its folder"""


def earlier_signoff(folder: Path, since: Path | None) -> tuple[Mapping[str, Any], str]:
    """Return the JSON object of an earlier sign-off, and its name. Both are empty without one.

    Parameters
    ----------
    folder
        Folder of the current sign-off, whose last record is the default.
    since
        Folder or record of an earlier sign-off, or None.

    Raises
    ------
    FileError
        If the specified record is missing or is not a sign-off.
    """
    place = folder if since is None else since
    path = place / RECORD if place.is_dir() or since is None else place
    try:
        content = json_object(path.read_bytes())
        if not isinstance(content.get("requirements"), list):
            raise ValueError("no requirements")
    except (OSError, ValueError) as error:
        if since is None and isinstance(error, FileNotFoundError):
            return {}, ""
        if since is None:
            warn(f"{path} is damaged, so the document lists no changes", stacklevel=2)
            return {}, ""
        reason = error.strerror if isinstance(error, OSError) else "it is not a sign-off"
        raise FileError(
            f"cannot read {path}: {reason}. Specify the folder of an earlier sign-off",
            name=str(path),
        ) from None
    return content, str(path)
