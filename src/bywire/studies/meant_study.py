"""The study file that was meant where none is, perhaps without its ending."""

from __future__ import annotations

import os
from pathlib import Path

from bywire.core.errors import FileError
from bywire.data.file_kinds import STUDY, near_files

_FOLDER = Path("studies")  # where study files usually are
_NEAR = 0.8  # resemblance of a study file that was meant


def require_study_file(file: Path) -> None:
    """Refuse a study file that is not there, before a folder is made by its name.

    Raises
    ------
    FileError
        With the one that was meant.
    """
    if os.path.isfile(file):
        return
    meant = meant_study(file)
    if meant is None and os.path.exists(file):
        return  # whoever reads it says what it is
    advice = "check the path" if meant is None else f"did you mean {meant}?"
    raise FileError(f"cannot read study file {file}: there is none: {advice}")


def meant_study(file: Path) -> Path | None:
    """Return the study file that is meant: its name, with its ending, is the same or near."""
    folders = dict.fromkeys((file.parent, _FOLDER)) if file.parent == Path() else (file.parent,)
    return next((path for _, path in near_files(file, (STUDY,), folders, _NEAR)), None)
