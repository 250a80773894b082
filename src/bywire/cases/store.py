"""Store of finished pieces of long work, so that an interrupted run can continue.

Large pieces are files in a folder with a record of the work (`PieceFolder`). Small pieces are
lines of one file (`PieceLines`). A killed process loses its unfinished pieces. A damaged piece
is treated as missing and is recomputed.
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
        If the file contains no JSON object, or an object that is nested too deeply.
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

    A piece's file is written completely or not at all. Two commands may use the same folder; if
    both compute the same piece, they only waste time.

    Parameters
    ----------
    folder
        The folder; it need not exist yet.
    """

    NOUN: ClassVar[str]
    """noun for the work, for messages and as the record's key of the identity"""
    KIND: ClassVar[str]
    """the same noun, specific enough to distinguish it from others"""
    COMMAND: ClassVar[str]
    """command that writes such folders"""
    RECORD: ClassVar[str]
    """file with the record of the work"""
    PIECES: ClassVar[str]
    """subfolder of the pieces"""
    FILE: ClassVar[str]
    """name of a piece's file by its number, as a format"""
    SAID: ClassVar[Mapping[str, type]]
    """other entries of the record, with their types"""

    folder: Path

    @property
    @abstractmethod
    def elsewhere(self) -> str:
        """Advice for a folder that contains the pieces of another plan."""

    def begin(self, plan: Plan, about: Mapping[str, Any]) -> None:
        """Create the folder of a plan, or reject the folder of another plan.

        Parameters
        ----------
        plan
            Plan of the pieces.
        about
            Other entries of the record.

        Raises
        ------
        FileError
            If the folder contains pieces of another plan, or cannot be written.
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
        """Return the folder's record, or reject a folder with the pieces of another plan.

        Raises
        ------
        FileError
            If the folder contains pieces of another plan, or no record.
        """
        known = self.record()
        if known["digest"] != plan.digest:
            differs = differing(known[self.NOUN], plan.identity)
            raise FileError(
                f"{self.folder} contains another {self.NOUN}{differs and f' ({differs})'}. "
                f"{self.elsewhere}",
                name=str(self.folder),
            )
        return known

    def record(self) -> dict[str, Any]:
        """Return the folder's record.

        Raises
        ------
        FileError
            If the folder contains no record.
        """
        path = self.folder / self.RECORD
        try:
            said = json_object(path.read_bytes())
            if all(isinstance(said[key], kind) for key, kind in self.SAID.items()):
                return said
        except OSError as error:
            raise FileError(
                f"{self.folder} does not contain a {self.NOUN} ({path.name}: {error.strerror}). "
                f"Specify the folder that '{self.COMMAND}' created",
                name=str(self.folder),
            ) from None
        except (ValueError, KeyError):
            pass
        raise FileError(
            f"{path} is damaged, or does not belong to a {self.KIND}. Run the {self.NOUN} in "
            "another folder",
            name=str(path),
        )

    def holds(self, plan: Plan) -> bool:
        """Return whether the folder already belongs to a plan."""
        try:
            return bool(self.record()["digest"] == plan.digest)
        except FileError:
            return False

    def path(self, number: int) -> Path:
        """Return the file of a piece."""
        return self.folder / self.PIECES / self.FILE.format(number)

    def finished(self) -> set[int]:
        """Return the numbers of the stored pieces."""
        files = (self.folder / self.PIECES).glob(f"*{Path(self.FILE).suffix}")
        return {int(path.stem) for path in files if path.stem.isdecimal()}

    def keep_file(self, number: int, write: Callable[[Path], object]) -> None:
        """Store a piece, completely or not at all.

        Parameters
        ----------
        number
            Number of the piece.
        write
            ``write(path)``: writes the piece to a file.

        Raises
        ------
        FileError
            If the file cannot be written.
        """
        self.keep_at(self.path(number), write)

    def keep_at(self, path: Path, write: Callable[[Path], object]) -> None:
        """Write a file of the folder, completely or not at all; see `keep_file`."""
        try:
            with replacing(path) as fresh:
                write(fresh)
        except OSError as error:
            raise self._unwritable(path, error) from None

    def _unwritable(self, path: Path, error: OSError) -> FileError:
        return FileError(
            f"cannot write {path}: {error.strerror or error}. Free some space, and resume the "
            f"{self.NOUN}. Finished work is saved",
            name=str(path),
        )


@dataclass(frozen=True)
class PieceLines:
    """File with a JSON object for each finished piece, one per line.

    Each object has a key, so that several computations can share the file.

    Parameters
    ----------
    path
        The file. If None, nothing is stored.
    """

    path: Path | None

    def pieces(self, read: Callable[[dict[str, Any]], T]) -> Iterator[tuple[str, T]]:
        """Yield key and value of the stored pieces, except a line that a killed run truncated.

        Parameters
        ----------
        read
            Converts an object without its key to the value. If it raises KeyError, TypeError or
            ValueError, the line is damaged.

        Raises
        ------
        FileError
            If the file cannot be read.
        """
        if self.path is None or not self.path.exists():
            return
        try:
            lines = self.path.read_text(encoding="utf-8").splitlines()
        except (OSError, UnicodeDecodeError) as error:
            raise FileError(
                f"cannot read {self.path}: {error}. To start again, delete this file",
                name=str(self.path),
            ) from None
        for line in lines:
            try:
                row = json_object(line)
                yield str(row.pop("key")), read(row)
            except (ValueError, KeyError, TypeError):
                continue

    def keep(self, key: str, row: Mapping[str, Any]) -> None:
        """Store a finished piece.

        Raises
        ------
        FileError
            If the file cannot be written.
        """
        if self.path is None:
            return
        line = json.dumps({"key": key, **row}).encode() + b"\n"
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            with self.path.open(
                "a+b", buffering=0
            ) as file:  # in a single write, since other processes may also write
                if file.tell():
                    file.seek(-1, 2)
                    # A line that a killed run truncated must not damage this line.
                    line = line if file.read(1) == b"\n" else b"\n" + line
                file.write(line)
        except OSError as error:
            raise FileError(
                f"cannot write {self.path}: {error.strerror}. Free some space, or choose another "
                "folder",
                name=str(self.path),
            ) from None
