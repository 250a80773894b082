"""Study that the user meant: a file, perhaps without its extension, or a folder."""

from __future__ import annotations

import os
from pathlib import Path

from bywire.core.errors import FileError
from bywire.data.toml_file import STUDY, first_there, kind_of_file, near_files

_FOLDER = Path("studies")  # usual folder of study files
_NEAR = 0.8  # minimum similarity of the name of a study file that may be intended


def require_study_file(file: Path) -> None:
    """Reject a missing study file, before a folder with its name is created.

    Raises
    ------
    FileError
        When the file is missing, with the intended file.
    """
    if os.path.isfile(file):
        return
    meant = meant_study(file)
    if meant is None and os.path.exists(file):
        return  # its reader raises a better error
    advice = "Check the path" if meant is None else f"Did you mean {meant}?"
    raise FileError(
        f"the study file {file} does not exist. {advice}", name=str(file), valid=str(meant or "")
    )


def meant_study(file: Path) -> Path | None:
    """Return the intended study file, which has the same or a similar name."""
    folders = dict.fromkeys((file.parent, _FOLDER)) if file.parent == Path() else (file.parent,)
    return next((path for _, path in near_files(file, (STUDY,), folders, _NEAR)), None)


# --- The folder of a study

RECORD = "study.json"
"""file that identifies the study of a folder"""
_RESULTS = Path("results")  # usual folders of results


def require_no_file(folder: Path) -> None:
    """Reject a file in place of a study's folder.

    Raises
    ------
    FileError
        When it is a file, with the folder of the study's results if it is known.
    """
    try:
        if not folder.is_file():
            return
    except (OSError, ValueError):  # ValueError: a null character in the path
        return
    near = (Path(folder.stem), _RESULTS / folder.stem, folder.parent)
    there = first_there(each / RECORD for each in near)
    is_study = kind_of_file(folder) == STUDY
    advice = (
        f"Did you mean {there.parent}?"
        if there is not None
        else f"To create its folder, type 'bywire study run {folder}'"
        if is_study
        else "Use the folder that 'bywire study run' created"
    )
    kind = "study file" if is_study else "file"
    raise FileError(f"{folder} is a {kind}, not a study's folder. {advice}", name=str(folder))
