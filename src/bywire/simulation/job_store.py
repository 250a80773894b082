"""Finished jobs of a long piece of work, in a file: what an interrupted run goes on from."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bywire.core.errors import FileError


@dataclass(frozen=True)
class JobStore:
    """A file with one JSON object a line, each a finished job.

    Parameters
    ----------
    path
        The file; without one nothing is kept.
    """

    path: Path | None

    def rows(self) -> Iterator[dict[str, Any]]:
        """Yield what is there; a last line that a killed run cut off is left out.

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
                f"{self.path} cannot be read: {error}; delete it to start anew"
            ) from None
        for line in lines:
            try:
                row = json.loads(line)
            except ValueError:
                continue
            if isinstance(row, dict):
                yield row

    def append(self, row: Mapping[str, Any]) -> None:
        """Keep a finished job.

        Raises
        ------
        FileError
            When the file cannot be written.
        """
        if self.path is None:
            return
        try:
            with self.path.open("a", encoding="utf-8") as file:
                file.write(json.dumps(dict(row)) + "\n")
        except OSError as error:
            raise FileError(
                f"cannot write {self.path}: {error.strerror}: make room there, or name another "
                "folder"
            ) from None
