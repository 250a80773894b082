"""The served folder, which no path can leave."""

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
_LONGEST = 100  # characters of an uploaded file's name
_LONGEST_FOLDER = 60  # characters of a result folder's name, each at most four bytes
_PLAIN = re.compile(r"[^A-Za-z0-9._-]+")


_claiming = threading.Lock()


@dataclass(frozen=True)
class Place:
    """Served folder and its files.

    Parameters
    ----------
    root
        Resolved path of the folder.
    """

    root: Path

    def inside(self, text: str) -> Path:
        """Return the path in the folder that a string specifies, whether or not it exists.

        Hidden files and links that leave the folder are excluded.

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
        except (OSError, RuntimeError, ValueError):  # a loop of links, or a name that is too long
            raise self.unknown(text) from None
        if not path.is_relative_to(self.root):
            raise self.unknown(text)
        if any(each.startswith(".") for each in path.relative_to(self.root).parts):  # via a link
            raise self.unknown(text)
        return path

    def file(self, text: str) -> Path:
        """Return the file that a string specifies.

        Raises
        ------
        RefusedError
            With status 404 if there is no such file.
        """
        path = self.inside(text)
        if not path.is_file():
            raise self.unknown(text)
        return path

    def unknown(self, text: str) -> RefusedError:
        """Return the error for a path that the server does not serve."""
        shown = text if len(text) <= _LONGEST else f"{text[:_LONGEST]}..."
        return RefusedError(
            404, f"the served folder does not contain {shown!r}. The start page lists its contents"
        )

    def named(self, path: Path) -> str:
        """Return a path's name in links, relative to the folder."""
        return path.relative_to(self.root).as_posix()

    def fresh_folder(self, stem: str) -> Path:
        """Return a new folder for a result.

        Raises
        ------
        FileError
            If the folder cannot be created.
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
            f"{parent} already contains 9,999 results of {stem}. Move them elsewhere",
            name=str(parent),
        )

    def same_folder(self, name: str) -> Path:
        """Return the only folder in which a file's result continues."""
        self._made(RESULTS)
        return self.inside(f"{RESULTS}/{folder_name(name)}")

    def folders(self, stem: str) -> list[Path]:
        """Return the result folders with a name, latest first."""
        found = {
            int(path.name.removeprefix(f"{stem}-")): path
            for path in self._made(RESULTS).glob(f"{escape(stem)}-*")
            if path.name.removeprefix(f"{stem}-").isdecimal() and path.resolve() == path
        }
        return [found[number] for number in sorted(found, reverse=True)]

    def measurements(self) -> Path:
        """Return the folder of uploaded measurements.

        Raises
        ------
        FileError
            If the folder cannot be created.
        """
        return self._made(MEASUREMENTS)

    def kept(self, fresh: Path, name: str) -> Path:
        """Move an uploaded measurement to the first free name, and return its path.

        This never replaces existing files, even if several files with one name arrive at the same
        time. Names that differ only in case are treated as equal, because some systems ignore case.

        Raises
        ------
        FileError
            If all names are taken.
        OSError
            If the folder is not writable.
        """
        parent, plain = self.measurements(), Path(safe_name(name))
        numbered = (f"{plain.stem}-{number}{plain.suffix}" for number in range(2, 10_000))
        with _claiming:
            taken = {each.casefold() for each in os.listdir(parent)}
            names = (each for each in (plain.name, *numbered) if each.casefold() not in taken)
            path = claim(fresh, (parent / each for each in names))
        if path is None:
            raise FileError(
                f"{parent} already contains 9,999 files named {plain.name}. Move them elsewhere",
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
    """Return the name of a file's result folder, which is unique for each file.

    If the file is in a subfolder, ``~1`` stands for the slash, as in JSON pointers.

    Examples
    --------
    >>> folder_name("tol.toml"), folder_name("a/tol.toml"), folder_name("a~1tol.toml")
    ('tol', 'a~1tol', 'a~01tol')
    """
    return shortened(name.removesuffix(".toml").replace("~", "~0").replace("/", "~1"))


def shortened(name: str) -> str:
    """Return a name short enough for a folder; a long one ends in a digest of the full name."""
    if len(name) <= _LONGEST_FOLDER:
        return name
    digest = hashlib.sha256(name.encode(errors="replace")).hexdigest()[:8]
    return f"{name[: _LONGEST_FOLDER - 9]}-{digest}"


def safe_name(name: str) -> str:
    """Return a plain file name that is safe on every system.

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
    if re.fullmatch(r"(?i)(con|prn|aux|nul|(com|lpt)\d)(\..*)?", plain):  # Windows devices
        plain = f"measurement-{plain}"
    return f"{plain}.{_PLAIN.sub('', ending)}" if dot and _PLAIN.sub("", ending) else plain


def place_of(folder: Path) -> Place:
    """Return the folder to serve.

    Raises
    ------
    FileError
        If the path is not a folder.
    """
    if not folder.is_dir():
        raise FileError(
            f"{folder} is not a folder. Specify the folder to serve with "
            f"{'--folder' if is_command_line() else 'folder'}",
            name=str(folder),
        )
    return Place(folder.resolve())


def require_inside(place: Place, settings: Mapping[str, str], keys: tuple[str, ...]) -> None:
    """Reject settings that name a file outside the folder.

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
        f"cannot create {path}: {error.strerror or error}. Free some space, or serve a folder to "
        "which you can write"
    )
