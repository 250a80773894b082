"""Kinds of TOML files that commands take, told by their keys; and which file was meant."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from difflib import SequenceMatcher
from pathlib import Path
from typing import Any

from bywire.core.errors import FileError, ParameterError
from bywire.data.toml_file import read_toml

BENCH, STUDY, LIFE, CAMPAIGN = "bench", "study", "life", "campaign"
_COMMANDS = {
    BENCH: "bywire run",
    STUDY: "bywire study run",
    LIFE: "bywire life",
    CAMPAIGN: "bywire faults",
}
_WORDS = {BENCH: "a bench", STUDY: "a study", LIFE: "a life", CAMPAIGN: "a campaign of faults"}
HEADS = {BENCH: "experiment", STUDY: "bench", LIFE: "life", CAMPAIGN: "bench"}
"""the key that each cannot do without"""
_OF_CAMPAIGNS = ("campaign", "criteria")
_NEVER_IN_STUDIES = {*_OF_CAMPAIGNS, "values", "residuals", "rates", "reaction"}
_NEVER_IN_CAMPAIGNS = {"design", "correlation", "requirements"}


def kind_of(content: Mapping[str, Any]) -> str:
    """Return what the content of a file is, by its keys; nothing where they do not tell.

    Examples
    --------
    >>> kind_of({"experiment": "hard-braking"}), kind_of({"bench": "b.toml", "vary": {}})
    ('bench', 'study')
    """
    keys = content.keys()
    if "life" in keys:
        return LIFE
    if "bench" not in keys:
        return BENCH if "experiment" in keys else ""
    if not keys & _NEVER_IN_STUDIES:
        return STUDY if keys & {"vary", "measured", *_NEVER_IN_CAMPAIGNS} else ""
    is_campaign = any(key in keys for key in _OF_CAMPAIGNS) and not keys & _NEVER_IN_CAMPAIGNS
    return CAMPAIGN if is_campaign else ""


def kind_of_file(file: Path) -> str:
    """Return what a file is, see `kind_of`; nothing of one that cannot be read."""
    try:
        return kind_of(read_toml(file, "file"))
    except FileError:
        return ""


def require_kind(content: Mapping[str, Any], wanted: str, file: Path) -> None:
    """Refuse the content of a file that is of another kind, and say which command takes it.

    Parameters
    ----------
    content
        What the file holds.
    wanted
        `BENCH`, `STUDY`, `LIFE` or `CAMPAIGN`.
    file
        Where it is.

    Raises
    ------
    ParameterError
        Without the file's name in front.
    """
    kind = kind_of(content)
    head = HEADS[wanted]
    if not kind or kind == wanted or (head in content and head != HEADS[kind]):
        return
    raise ParameterError(
        f"this is {_WORDS[kind]} and not {_WORDS[wanted]}: '{_COMMANDS[kind]} {file}' takes it"
    )


# --- Which file was meant where another is named: in a usual folder, or the nearest of its kind

_ENDING = ".toml"


def first_there(places: Iterable[Path]) -> Path | None:
    """Return the first of several places at which there is a file; None where none has one."""
    try:
        return next((place for place in places if place.is_file()), None)
    except (OSError, ValueError):  # ValueError: a null character in the path
        return None


def near_files(
    file: Path,
    kinds: Collection[str],
    folders: Iterable[Path],
    least: float,
    *,
    with_ending: bool = False,
) -> Iterator[tuple[float, Path]]:
    """Yield the files that a name resembles, each with how much, the likest first.

    Parameters
    ----------
    file
        What was named; the folder that it names does not count.
    kinds
        Kinds of files that are wanted, see `bywire.data.file_kinds.kind_of`.
    folders
        Where to look; of two files of one name, the one in the later folder goes before.
    least
        Resemblance from which on a file counts, up to 1.
    with_ending
        Whether names are compared with their endings.
    """
    word = file.name if with_ending else file.name.removesuffix(_ENDING)
    near = []
    try:
        for order, folder in enumerate(folders):
            for path in folder.glob(f"*{_ENDING}"):
                name = path.name if with_ending else path.stem
                likeness = SequenceMatcher(None, name, word).ratio()
                if likeness >= least:
                    near.append((likeness, name, order, path))
    except (OSError, ValueError):  # ValueError: a null character in the path
        return
    for likeness, _, _, path in sorted(near, reverse=True):
        if kind_of_file(path) in kinds:
            yield likeness, path
