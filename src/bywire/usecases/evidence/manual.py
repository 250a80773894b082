"""Evidence that a person provides: an inspection, a test on the road, a review."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import date
from pathlib import Path
from typing import Annotated, Any, Literal

from bywire.api.signoff import ManualEntry
from bywire.bench.requirements import Limit
from bywire.core.errors import FileError, ParameterError, not_valid, quoted, unknown_of_few
from bywire.core.section import Hint, Name, Section
from bywire.core.typing import Progress
from bywire.signoff.plan import Computed, Task
from bywire.usecases.evidence.entry import Origin, file_digest, require_file

KEYS = ("person", "date", "file", "sha256", "verdict")


_DIGEST = re.compile("[0-9a-f]{64}")


class ManualSection(Section):
    """Keys of a manual entry."""

    person: Name
    date: Any
    file: Name
    sha256: Name
    verdict: Annotated[Literal["met", "missed"], Hint('write "met" or "missed"')]


@dataclass(frozen=True)
class ManualTask(Task):
    """Evidence that a person provides.

    Parameters
    ----------
    entry
        The statement with its file.
    arguments, folder
        Content of the entry, and the folder of the sign-off file.
    """

    entry: ManualEntry
    arguments: Mapping[str, Any]
    folder: Path

    @property
    def origin(self) -> Origin:
        """The reader and its arguments, for another process."""
        return read_manual, (self.entry.what, self.arguments, self.folder)

    @property
    def title(self) -> str:
        """The entry in one line."""
        return f"manual {self.entry.what}"

    @property
    def identity(self) -> Mapping[str, Any]:
        """Everything that affects its figures."""
        entry = self.entry
        return {
            "kind": "manual",
            "what": entry.what,
            "person": entry.person,
            "date": entry.date,
            "file": entry.file.name,
            "digest": entry.digest,
            "verdict": entry.verdict,
        }

    def limit(self, text: str) -> Limit:
        """Return a limit of one of its figures."""
        raise ParameterError(
            "[[evidence]] manual does not accept a limit, because the person decides. Remove the "
            "key limit",
            name="limit",
            value=text,
        )

    def compute(self, folder: Path, progress: Progress) -> Computed:
        """Compute the result, and write its report."""
        del progress
        self.entry.write(folder)
        return Computed(self.entry)


def read_manual(what: str, arguments: Mapping[str, Any], folder: Path) -> ManualTask:
    """Read a manual entry, and compare its file with the digest.

    Raises
    ------
    FileError
        If the file is missing or has changed.
    InputError
        For other invalid entries.
    """
    for name in arguments:
        if name not in KEYS:
            raise unknown_of_few("key of [[evidence]] manual", name, (*KEYS, "shows", "note"))
    path = arguments.get("file")
    if path is None:
        raise ParameterError(
            '[[evidence]] manual needs the file that documents the statement. Add file = "PATH"',
            name="file",
        )
    if isinstance(path, str) and "sha256" not in arguments:
        require_file(folder / path)
        raise ParameterError(
            "[[evidence]] manual needs the digest of its file, so that bywire can detect a later "
            f'change. Add sha256 = "{file_digest(folder / path)}"',
            name="sha256",
        )
    section = ManualSection.read(arguments, "[[evidence]] manual")
    file = folder / section.file
    require_file(file)
    if not _DIGEST.fullmatch(section.sha256.lower()):
        raise not_valid(
            "[[evidence]] sha256", quoted(section.sha256), "a digest of 64 hexadecimal digits"
        )
    found = file_digest(file)
    if found != section.sha256.lower():
        raise FileError(
            f"{file} has changed. Its SHA-256 digest is {found}, not {section.sha256}. Inspect the "
            "file again, and update person, date and sha256",
            name=str(file),
            value=found,
            valid=section.sha256,
        )
    entry = ManualEntry(what, section.person, _date(section.date), file, found, section.verdict)
    return ManualTask(entry, arguments, folder)


def _date(value: Any) -> str:
    """Return a date as ``YYYY-MM-DD``."""
    try:
        day = value if type(value) is date else date.fromisoformat(value)
    except (TypeError, ValueError):
        raise not_valid(
            "[[evidence]] date", quoted(value), "a date such as 2026-11-27", kind=ParameterError
        ) from None
    if day > date.today():
        raise not_valid("[[evidence]] date", day.isoformat(), "a date that is not in the future")
    return day.isoformat()
