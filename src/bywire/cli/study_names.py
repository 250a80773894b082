"""What is meant by a word behind ``bywire study``: a study file without its ending, perhaps."""

from __future__ import annotations

import os
from difflib import get_close_matches
from pathlib import Path

from bywire.core.brake import loaded_files
from bywire.core.errors import FileError, UnknownNameError, unknown_name

_ENDING = ".toml"
_FOLDER = Path("studies")  # where study files usually are
_NEAR = 0.8  # resemblance of a study file that was meant


def require_sizing(name: str) -> None:
    """Refuse a word that is no sizing study.

    Raises
    ------
    UnknownNameError
        With the command that runs the study file that was meant, or the nearest sizing studies.
    """
    from bywire.synthesis.study import STUDIES

    if STUDIES.get(name) is not None:
        return
    file = _meant(Path(name))
    if file is not None:
        raise UnknownNameError(
            f"unknown sizing study {name!r}: the study file {file} is run by 'bywire study run "
            f"{file}'"
        )
    if loaded_files():
        raise STUDIES.unknown(name)  # with how a brake of one's own declares one
    error = str(unknown_name("sizing study", name, STUDIES.all()))
    more = (
        "; one of a brake of your own takes --system PATH, and a study file is run by 'bywire "
        "study run FILE'"
    )
    raise UnknownNameError(error if error.endswith("?") else error + more)


def require_study_file(file: Path) -> None:
    """Refuse a study file that is not there, before a folder is made by its name.

    Raises
    ------
    FileError
        With the one that was meant.
    """
    if os.path.isfile(file):
        return
    meant = _meant(file)
    if meant is None and os.path.exists(file):
        return  # whoever reads it says what it is
    advice = "check the path" if meant is None else f"did you mean {meant}?"
    raise FileError(f"cannot read study file {file}: there is none: {advice}")


def _meant(file: Path) -> Path | None:
    """Return the study file that is meant: its name, with its ending, is the same or near."""
    from bywire.data.file_kinds import STUDY, kind_of_file

    stem = file.name.removesuffix(_ENDING)
    places = dict.fromkeys((file.parent, _FOLDER)) if file.parent == Path() else (file.parent,)
    try:
        there = {path.stem: path for place in places for path in sorted(place.glob(f"*{_ENDING}"))}
    except (OSError, ValueError):  # ValueError: a null character in the path
        return None
    for near in get_close_matches(stem, there, n=3, cutoff=_NEAR):
        if kind_of_file(there[near]) == STUDY:
            return there[near]
    return None
