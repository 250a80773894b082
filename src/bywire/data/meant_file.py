"""Which file was meant where another is named: in a usual folder, or the nearest of its kind."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from difflib import SequenceMatcher
from pathlib import Path

from bywire.data.file_kinds import kind_of_file

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
