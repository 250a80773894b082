"""The folder of a study, where it is named: a file is none."""

from __future__ import annotations

from pathlib import Path

from bywire.core.errors import FileError
from bywire.data.file_kinds import STUDY, first_there, kind_of_file

RECORD = "study.json"
"""file that says which study a folder holds"""
_RESULTS = Path("results")  # where folders of results usually are


def require_no_file(folder: Path) -> None:
    """Refuse a file where the folder of a study is wanted.

    Raises
    ------
    FileError
        Naming the folder that the study was run into, where it is known.
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
        f"did you mean {there.parent}?"
        if there is not None
        else f"'bywire study run {folder}' makes one"
        if is_study
        else "name the one that 'bywire study run' has written"
    )
    kind = "study file" if is_study else "file"
    raise FileError(f"{folder} is a {kind}, and the folder of a study is wanted: {advice}")
