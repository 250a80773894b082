"""The folder that is served, which no path leads out of."""

from __future__ import annotations

import hashlib
import os
import re
import threading
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from glob import escape
from pathlib import Path, PurePosixPath

from bywire.core.callers import is_command_line
from bywire.core.errors import FileError
from bywire.core.scratch import claim
from bywire.server.exchange import RefusedError

RESULTS, MEASUREMENTS = "results", "measurements"
_LONGEST = 100  # characters of the name of a file that was dropped
_LONGEST_FOLDER = 60  # characters of the name of a result's folder, of four bytes at most
_PLAIN = re.compile(r"[^A-Za-z0-9._-]+")


_claiming = threading.Lock()


@dataclass(frozen=True)
class Place:
    """A folder and what is in it.

    Parameters
    ----------
    root
        The folder, resolved.
    """

    root: Path

    def inside(self, text: str) -> Path:
        """Return the path that a text names in the folder, whether or not anything is there.

        Hidden files are no part of what is served, and links that lead out lead nowhere.

        Raises
        ------
        RefusedError
            With status 404 for any other path.
        """
        parts = PurePosixPath(text).parts
        is_plain = parts and not any(each.startswith(".") or "\\" in each for each in parts)
        if not is_plain or text.startswith("/") or "\0" in text or os.path.isabs(text):
            raise self.unknown(text)
        try:
            path = (self.root / text).resolve()
            with suppress(FileNotFoundError, NotADirectoryError):
                path.lstat()
        except (OSError, RuntimeError, ValueError):  # a circle of links, too long a name
            raise self.unknown(text) from None
        if not path.is_relative_to(self.root):
            raise self.unknown(text)
        if any(each.startswith(".") for each in path.relative_to(self.root).parts):  # by a link
            raise self.unknown(text)
        return path

    def file(self, text: str) -> Path:
        """Return the file that a text names.

        Raises
        ------
        RefusedError
            With status 404 where there is none.
        """
        path = self.inside(text)
        if not path.is_file():
            raise self.unknown(text)
        return path

    def unknown(self, text: str) -> RefusedError:
        """Return what is said of a path that is not served."""
        shown = text if len(text) <= _LONGEST else f"{text[:_LONGEST]}..."
        return RefusedError(
            404, f"there is no {shown!r} in the folder that is served: the start page lists it"
        )

    def named(self, path: Path) -> str:
        """Return how links call a path of the folder."""
        return path.relative_to(self.root).as_posix()

    def fresh_folder(self, stem: str) -> Path:
        """Return a new folder for a result.

        Raises
        ------
        FileError
            When it cannot be made.
        """
        parent = self._made(RESULTS)
        for number in range(1, 10_000):
            folder = parent / f"{stem}-{number}"
            try:
                folder.mkdir()
            except FileExistsError:
                continue
            except OSError as error:
                raise _unwritable(folder, error) from None
            return folder
        raise FileError(
            f"{parent} contains 9,999 results of {stem}: move them elsewhere", name=str(parent)
        )

    def same_folder(self, name: str) -> Path:
        """Return the one folder of a file's result that is gone on with."""
        self._made(RESULTS)
        return self.inside(f"{RESULTS}/{folder_name(name)}")

    def folders(self, stem: str) -> list[Path]:
        """Return the folders of results of a name, the latest first."""
        found = {
            int(path.name.removeprefix(f"{stem}-")): path
            for path in self._made(RESULTS).glob(f"{escape(stem)}-*")
            if path.name.removeprefix(f"{stem}-").isdecimal() and path.resolve() == path
        }
        return [found[number] for number in sorted(found, reverse=True)]

    def measurements(self) -> Path:
        """Return the folder of measurements that were dropped.

        Raises
        ------
        FileError
            When it cannot be made.
        """
        return self._made(MEASUREMENTS)

    def kept(self, fresh: Path, name: str) -> Path:
        """Give a measurement, written beside the others, the first free name; return its place.

        Nothing is ever replaced, also where several files of one name arrive at once. Names that
        differ in upper and lower case alone count as one, for the systems on which they are.

        Raises
        ------
        FileError
            When all names are taken.
        OSError
            When the folder cannot be written to.
        """
        parent, plain = self.measurements(), Path(safe_name(name))
        numbered = (f"{plain.stem}-{number}{plain.suffix}" for number in range(2, 10_000))
        with _claiming:
            taken = {each.casefold() for each in os.listdir(parent)}
            names = (each for each in (plain.name, *numbered) if each.casefold() not in taken)
            path = claim(fresh, (parent / each for each in names))
        if path is None:
            raise FileError(
                f"{parent} contains 9,999 files named {plain.name}: move them elsewhere",
                name=str(parent),
            )
        return path

    def _made(self, name: str) -> Path:
        folder = self.inside(name)
        try:
            folder.mkdir(exist_ok=True)
        except OSError as error:
            raise _unwritable(folder, error) from None
        return folder


def folder_name(name: str) -> str:
    """Return what the folder of a file's result is called: no two files of a folder share one.

    Where the file lies deeper, ``~1`` stands for the slash, as in JSON pointers.

    Examples
    --------
    >>> folder_name("tol.toml"), folder_name("a/tol.toml"), folder_name("a~1tol.toml")
    ('tol', 'a~1tol', 'a~01tol')
    """
    return shortened(name.removesuffix(".toml").replace("~", "~0").replace("/", "~1"))


def shortened(name: str) -> str:
    """Return a name that is short enough for a folder; long ones end in a digest of the whole."""
    if len(name) <= _LONGEST_FOLDER:
        return name
    digest = hashlib.sha256(name.encode(errors="replace")).hexdigest()[:8]
    return f"{name[: _LONGEST_FOLDER - 9]}-{digest}"


def safe_name(name: str) -> str:
    """Return a name that is a file's in one folder, and nothing else on any system.

    Examples
    --------
    >>> safe_name("../../Fahrt 7 (naß).csv")
    'Fahrt-7-na.csv'
    >>> safe_name(".csv"), safe_name("con.csv")
    ('measurement.csv', 'measurement-con.csv')
    """
    last = re.split(r"[/\\]", name)[-1]
    stem, dot, ending = last.rpartition(".")
    plain = _PLAIN.sub("-", stem if dot else last).strip("-._")[:_LONGEST] or "measurement"
    if re.fullmatch(r"(?i)(con|prn|aux|nul|(com|lpt)\d)(\..*)?", plain):  # devices of Windows
        plain = f"measurement-{plain}"
    return f"{plain}.{_PLAIN.sub('', ending)}" if dot and _PLAIN.sub("", ending) else plain


def place_of(folder: Path) -> Place:
    """Return the folder to serve.

    Raises
    ------
    FileError
        When it is no folder.
    """
    if not folder.is_dir():
        raise FileError(
            f"{folder} is not a folder: name the one to serve with "
            f"{'--folder' if is_command_line() else 'folder'}",
            name=str(folder),
        )
    return Place(folder.resolve())


def require_inside(place: Place, settings: Mapping[str, str], keys: tuple[str, ...]) -> None:
    """Refuse settings that name a file outside of the folder.

    Raises
    ------
    RefusedError
        With status 404.
    """
    for key, value in settings.items():
        if key.rpartition(".")[2] in keys:
            place.file(value)


def _unwritable(path: Path, error: OSError) -> FileError:
    return FileError(
        f"cannot make {path}: {error.strerror or error}: make room there, or serve a folder that "
        "you may write to"
    )
