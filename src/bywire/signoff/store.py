"""Stored evidence: figures and verdicts of each finished computation, with its own result."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from bywire.bench.kpis.kpi import Kpi
from bywire.cases.identity import as_json
from bywire.cases.store import json_object
from bywire.core.errors import FileError
from bywire.core.scratch import UNFINISHED, replacing
from bywire.report.answer import OUTCOMES, FigureAt, Outcome
from bywire.signoff.judging import Judged, judged_from
from bywire.signoff.plan import Computed, Task

RECORD = "evidence.json"
EVIDENCE = "evidence"
"""subfolder of the evidence"""
_PAGE = "report.html"
_WORDS = re.compile(r"[^a-z0-9]+")
_LONGEST = 48  # characters of a folder's name without its digits


@dataclass(frozen=True)
class Kept:
    """Finished evidence.

    Parameters
    ----------
    title
        Title of its task.
    digest, identity
        Digest of everything that affects the figures, and those entries.
    figures
        Its figures.
    outcome, summary
        Verdict of the result as a whole, and the result in one line.
    judged
        Verdicts on limits that only the complete result can judge, by the limit's text.
    warnings
        Warnings and failed checks of the result.
    folder
        Name of its folder.
    page
        Name of its report in this folder; empty without one.
    """

    title: str
    digest: str
    identity: Mapping[str, Any]
    figures: tuple[FigureAt, ...]
    outcome: Outcome
    summary: str
    judged: Mapping[str, Judged]
    warnings: tuple[str, ...]
    folder: str
    page: str


@dataclass(frozen=True)
class EvidenceStore:
    """Folder with a subfolder for the evidence of each task.

    Parameters
    ----------
    folder
        Folder of the sign-off; it need not exist yet.
    """

    folder: Path

    def place(self, task: Task) -> Path:
        """Return the folder of a task."""
        return self.folder / EVIDENCE / _folder_name(task)

    def kept(self, task: Task) -> Kept | None:
        """Return the stored evidence of a task; None if it is missing, damaged or outdated."""
        kept = _read(self.place(task))
        return kept if kept is not None and kept.digest == task.digest else None

    def every(self) -> list[Kept]:
        """Return all stored evidence."""
        places = sorted((self.folder / EVIDENCE).glob(f"*/{RECORD}"))
        return [kept for place in places if (kept := _read(place.parent)) is not None]

    def keep(self, task: Task, computed: Computed) -> None:
        """Store the evidence of a task atomically, in the folder of its result.

        Raises
        ------
        FileError
            If the file cannot be written.
        """
        place, answer = self.place(task), computed.answer
        document = answer.document()
        said = {
            "title": task.title,
            "digest": task.digest,
            "identity": as_json(task.identity),
            "figures": [{"at": each.at, **asdict(each.kpi)} for each in answer.key_figures],
            "outcome": answer.outcome,
            "summary": document.banner.text if document.banner else document.title,
            "judged": {text: each.as_object() for text, each in computed.judged.items()},
            "warnings": [*answer.failures, *answer.warnings],
            "page": _PAGE if (place / _PAGE).is_file() else "",
            "files": _sizes(place),
        }
        record = {"checksum": _checksum(said), **said}
        try:
            place.mkdir(parents=True, exist_ok=True)
            with replacing(place / RECORD) as fresh:
                fresh.write_text(json.dumps(record, indent=2) + "\n", encoding="utf-8")
        except OSError as error:
            raise FileError(
                f"cannot write {place / RECORD}: {error.strerror or error}. Free some space, and "
                "rerun the command. Finished evidence is saved",
                name=str(place / RECORD),
            ) from None


def _folder_name(task: Task) -> str:
    words = _WORDS.sub("-", task.title.lower()).strip("-")[:_LONGEST].rstrip("-")
    return f"{words}-{task.shelf[:10]}"


def _checksum(said: Mapping[str, Any]) -> str:
    return hashlib.sha256(json.dumps(said, sort_keys=True).encode()).hexdigest()


def _sizes(place: Path) -> dict[str, int]:
    """Return the size of every file of a result, so that a damaged one is noticed."""
    files = sorted(path for path in place.glob("*") if path.is_file() and path.name != RECORD)
    return {path.name: path.stat().st_size for path in files}


def _read(place: Path) -> Kept | None:
    """Return the evidence in a folder; None if it is missing, incomplete or damaged."""
    try:
        said = json_object((place / RECORD).read_bytes())
        if said.pop("checksum") != _checksum(said) or (place / UNFINISHED).exists():
            return None
        page = str(said["page"])
        if page not in ("", _PAGE) or (page and not (place / page).is_file()):
            return None
        present = _sizes(place)
        if any(present.get(name) != size for name, size in said["files"].items()):
            return None
        if said["outcome"] not in OUTCOMES:
            return None
        return Kept(
            str(said["title"]),
            str(said["digest"]),
            dict(said["identity"]),
            tuple(_figure(each) for each in said["figures"]),
            said["outcome"],
            str(said["summary"]),
            {str(text): judged_from(each) for text, each in said["judged"].items()},
            tuple(map(str, said["warnings"])),
            place.name,
            page,
        )
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return None


def _figure(fields: dict[str, Any]) -> FigureAt:
    at = fields.pop("at")
    return FigureAt(Kpi(**fields), str(at))
