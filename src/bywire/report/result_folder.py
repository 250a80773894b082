"""Folder of one result: a new result replaces the old one when it is complete.

A process that is killed while it computes or draws leaves the folder unchanged. While files are
moved, a file ``unfinished`` marks the folder and lists the files of both results.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from html import escape, unescape
from pathlib import Path

from bywire.core.errors import FileError
from bywire.core.scratch import UNFINISHED, scratch_folder

PAGE = "report.html"
"""file of the page, which lists the files of its result"""

_SAYS = "This result is incomplete. Rerun the same command to write it again. Its files:"
_OURS = (".html", ".json", ".nc", ".png", ".toml")
_META = "bywire-files"
_HEAD = 65536  # characters of a page that contain its list, which is at the beginning


class ResultFolder:
    """Temporary place of a result's files before they replace those of an older result.

    Parameters
    ----------
    folder
        The folder of the result.
    scratch
        Folder for the files until then.
    """

    def __init__(self, folder: Path, scratch: Path) -> None:
        self.folder, self.scratch = folder, scratch

    def move(self, is_whole: bool = True) -> None:
        """Move the files into place, remove the older result's, and mark incomplete results."""
        new = [path.name for path in self.scratch.iterdir() if path.is_file()]
        if not new:
            return
        for name in new:
            if (self.folder / name).is_dir():
                raise FileError(
                    f"cannot write {self.folder / name}: a folder of that name already "
                    "exists. Remove it, or choose another folder for the result",
                    name=str(self.folder / name),
                )
        old = earlier_files(self.folder)
        marker = self.scratch / UNFINISHED
        marker.write_text("\n".join([_SAYS, *sorted({*new, *old})]) + "\n", encoding="utf-8")
        os.replace(marker, self.folder / UNFINISHED)
        for name in sorted(old - set(new)):
            (self.folder / name).unlink(missing_ok=True)
        for name in sorted(new, key=_order):
            os.replace(self.scratch / name, self.folder / name)
        if is_whole:
            (self.folder / UNFINISHED).unlink()


@contextmanager
def result_folder(folder: Path) -> Iterator[ResultFolder]:
    """Yield the folder for the files of a result, which are moved at the end of the block.

    Raises
    ------
    FileError
        When the folder cannot be created or is not writable. The older result then remains.
    KeyboardInterrupt
        When interrupted, with advice. The written files are then in the folder, marked as
        unfinished.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        reason = error.strerror or str(error)
        raise FileError(
            f"cannot create the output folder {folder}: {reason}", name=str(folder)
        ) from None
    try:
        with scratch_folder(folder) as scratch:
            place = ResultFolder(folder, scratch)
            try:
                yield place
            except KeyboardInterrupt:
                place.move(is_whole=False)
                raise
            place.move()
    except KeyboardInterrupt:
        raise KeyboardInterrupt(
            f"the report in {folder} is incomplete. Rerun the same command to complete it"
        ) from None
    except OSError as error:
        reason = error.strerror or str(error)
        raise FileError(
            f"cannot write the result to {folder}: {reason}. Free some space there, or choose "
            "another folder",
            name=str(folder),
        ) from None


def listed(names: Sequence[str]) -> str:
    """Return the element of a page's head that lists the files of its result."""
    return f'<meta name="{_META}" content="{escape(json.dumps(list(names)))}">\n' if names else ""


def earlier_files(folder: Path) -> set[str]:
    """Return the names of the files of the result in a folder, complete or not."""
    names: set[str] = set()
    for path in folder.glob("*.json"):
        files = _files_of(path)
        names |= files if path.name in files else set()  # our records list themselves
    names |= _files_of_page(folder / PAGE)
    if (folder / UNFINISHED).is_file():
        text = (folder / UNFINISHED).read_text(encoding="utf-8", errors="replace")
        names |= {Path(line).name for line in text.splitlines()[1:]}
    return {n for n in names if Path(n).suffix in _OURS and (folder / n).is_file()}


def _files_of(record: Path) -> set[str]:
    try:
        return {Path(str(each)).name for each in json.loads(record.read_bytes())["files"]}
    except (OSError, ValueError, KeyError, TypeError):  # not ours
        return set()


def _files_of_page(page: Path) -> set[str]:
    try:
        with page.open(encoding="utf-8") as stream:
            entry = re.search(rf'<meta name="{_META}" content="([^"]*)">', stream.read(_HEAD))
        names = json.loads(unescape(entry[1])) if entry else []
        return {Path(str(each)).name for each in names}
    except (OSError, ValueError, TypeError):  # not ours
        return set()


def _order(name: str) -> tuple[bool, str]:
    """Return the order of moving: values never exist without the record of their validity."""
    return Path(name).suffix != ".json", name
