"""What is meant by a word behind ``bywire study``: a sizing study, or perhaps a study file."""

from __future__ import annotations

from pathlib import Path

from bywire.core.brake import loaded_files
from bywire.core.errors import UnknownNameError, unknown_name


def require_sizing(name: str) -> None:
    """Refuse a word that is no sizing study.

    Raises
    ------
    UnknownNameError
        With the command that runs the study file that was meant, or the nearest sizing studies.
    """
    from bywire.studies.meant_study import meant_study
    from bywire.synthesis.study import STUDIES

    if STUDIES.get(name) is not None:
        return
    file = meant_study(Path(name))
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
