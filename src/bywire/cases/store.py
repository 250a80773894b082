"""Store of finished pieces of long work, from which an interrupted run continues.

Large pieces are files of a folder, with a record that says whose they are (`PieceFolder`); small
ones are lines of one file (`PieceLines`). A killed process loses the pieces that it was at. A
damaged piece counts as missing, and is computed again.
"""

from __future__ import annotations

import json
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, TypeVar

from bywire.cases.identity import Plan, differing
from bywire.core.errors import FileError
from bywire.core.scratch import replacing, sweep

T = TypeVar("T")


def json_object(text: bytes | str) -> dict[str, Any]:
    """Return the JSON object of an untrusted file.

    Raises
    ------
    ValueError
        When it is not one, or nested too deeply.
    """
    try:
        value = json.loads(text)
    except RecursionError:
        raise ValueError("nested too deeply") from None
    if not isinstance(value, dict):
        raise ValueError("not an object")
    return value


@dataclass(frozen=True)
class PieceFolder(ABC):
    """Folder with a record of the work, and a file for each finished piece.

    A piece's file appears whole or not at all. Two commands may work at one folder: they lose time
    where both compute a piece, and nothing else.

    Parameters
    ----------
    folder
        The folder; it need not exist yet.
    """

    NOUN: ClassVar[str]
    """what its pieces are of, for messages and as the record's key of the identity"""
    KIND: ClassVar[str]
    """the same, told from others of that name"""
    COMMAND: ClassVar[str]
    """command that writes such folders"""
    RECORD: ClassVar[str]
    """file that says whose pieces the folder holds"""
    PIECES: ClassVar[str]
    """folder of the pieces in it"""
    FILE: ClassVar[str]
    """name of a piece's file by its number, as a format"""
    SAID: ClassVar[Mapping[str, type]]
    """what the record says, with its type"""

    folder: Path

    @property
    @abstractmethod
    def elsewhere(self) -> str:
        """What to do where the folder holds the pieces of another plan."""

    def begin(self, plan: Plan, about: Mapping[str, Any]) -> None:
        """Make the folder that of a plan, or refuse that of another.

        Parameters
        ----------
        plan
            Whose pieces it is to hold.
        about
            What else its record says.

        Raises
        ------
        FileError
            When it holds the pieces of another plan, or cannot be written.
        """
        record = self.folder / self.RECORD
        if record.exists():
            self.require(plan)
        try:
            (self.folder / self.PIECES).mkdir(parents=True, exist_ok=True)
            sweep(self.folder / self.PIECES)
            said = {"digest": plan.digest, **about, self.NOUN: plan.identity}
            with replacing(record) as fresh:
                fresh.write_text(json.dumps(said, indent=2) + "\n", encoding="utf-8")
        except OSError as error:
            raise self._unwritable(self.folder, error) from None

    def require(self, plan: Plan) -> dict[str, Any]:
        """Return what the folder says, or refuse it where it holds the pieces of another plan.

        Raises
        ------
        FileError
            When it does, or holds none.
        """
        known = self.record()
        if known["digest"] != plan.digest:
            differs = differing(known[self.NOUN], plan.identity)
            raise FileError(
                f"{self.folder} contains another {self.NOUN}{differs and f' ({differs})'}: "
                f"{self.elsewhere}",
                name=str(self.folder),
            )
        return known

    def record(self) -> dict[str, Any]:
        """Return what the folder says of its pieces.

        Raises
        ------
        FileError
            When it holds none.
        """
        path = self.folder / self.RECORD
        try:
            said = json_object(path.read_bytes())
            if all(isinstance(said[key], kind) for key, kind in self.SAID.items()):
                return said
        except OSError as error:
            raise FileError(
                f"{self.folder} does not contain a {self.NOUN} ({path.name}: {error.strerror}): "
                f"name the folder that '{self.COMMAND}' has written",
                name=str(self.folder),
            ) from None
        except (ValueError, KeyError):
            pass
        raise FileError(
            f"{path} is damaged, or not of a {self.KIND}: run the {self.NOUN} into another folder",
            name=str(path),
        )

    def holds(self, plan: Plan) -> bool:
        """Return whether the folder is that of a plan already."""
        try:
            return bool(self.record()["digest"] == plan.digest)
        except FileError:
            return False

    def path(self, number: int) -> Path:
        """Return the file of a piece."""
        return self.folder / self.PIECES / self.FILE.format(number)

    def finished(self) -> set[int]:
        """Return the numbers of the pieces that are there."""
        files = (self.folder / self.PIECES).glob(f"*{Path(self.FILE).suffix}")
        return {int(path.stem) for path in files if path.stem.isdecimal()}

    def keep_file(self, number: int, write: Callable[[Path], object]) -> None:
        """Keep a piece, whole or not at all.

        Parameters
        ----------
        number
            Of the piece.
        write
            Writes it to a file of this path.

        Raises
        ------
        FileError
            When it cannot be written.
        """
        path = self.path(number)
        try:
            with replacing(path) as fresh:
                write(fresh)
        except OSError as error:
            raise self._unwritable(path, error) from None

    def _unwritable(self, path: Path, error: OSError) -> FileError:
        return FileError(
            f"cannot write {path}: {error.strerror or error}: make room there and resume the "
            f"{self.NOUN}; finished pieces are kept",
            name=str(path),
        )


@dataclass(frozen=True)
class PieceLines:
    """A file with a JSON object for each finished piece, one per line.

    Each has a key, by which several pieces of work share the file.

    Parameters
    ----------
    path
        The file; without one nothing is kept.
    """

    path: Path | None

    def pieces(self, read: Callable[[dict[str, Any]], T]) -> Iterator[tuple[str, T]]:
        """Yield key and value of the pieces that are there; what a killed run cut off is left out.

        Parameters
        ----------
        read
            Makes the value of an object without its key; where it raises KeyError, TypeError or
            ValueError the line is damaged.

        Raises
        ------
        FileError
            When the file cannot be read.
        """
        if self.path is None or not self.path.exists():
            return
        try:
            lines = self.path.read_text(encoding="utf-8").splitlines()
        except (OSError, UnicodeDecodeError) as error:
            raise FileError(
                f"{self.path} cannot be read: {error}; delete it to start again",
                name=str(self.path),
            ) from None
        for line in lines:
            try:
                row = json_object(line)
                yield str(row.pop("key")), read(row)
            except (ValueError, KeyError, TypeError):
                continue

    def keep(self, key: str, row: Mapping[str, Any]) -> None:
        """Keep a finished piece.

        Raises
        ------
        FileError
            When the file cannot be written.
        """
        if self.path is None:
            return
        line = json.dumps({"key": key, **row}).encode() + b"\n"
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            with self.path.open("a+b", buffering=0) as file:  # in one write, whoever else writes
                if file.tell():
                    file.seek(-1, 2)
                    # A line that a killed run cut off must not take this one with it.
                    line = line if file.read(1) == b"\n" else b"\n" + line
                file.write(line)
        except OSError as error:
            raise FileError(
                f"cannot write {self.path}: {error.strerror}: make room there, or name another "
                "folder",
                name=str(self.path),
            ) from None
