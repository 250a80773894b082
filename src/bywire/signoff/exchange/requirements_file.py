"""Requirements file of another tool: its entries, and results written into a copy of it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import AnyStr

LARGEST = 20_000_000
"""maximum size of a requirements file in bytes, checked before parsing"""

LONGEST = 32_000
"""maximum number of characters in a result; a spreadsheet's cell has at most 32,767"""

_PREFIX = "bywire."


@dataclass(frozen=True)
class Result:
    """Result of a requirement as texts, with one line per piece of evidence.

    Parameters
    ----------
    verdict
        The verdict.
    reason
        Reasons for a verdict other than ``met``.
    evidence
        Titles of the evidence.
    value, limit, margin
        Figures of the evidence with their units.
    date
        Date of the sign-off.
    """

    verdict: str
    reason: str
    evidence: str
    value: str
    limit: str
    margin: str
    date: str

    def by_attribute(self) -> dict[str, str]:
        """Return the texts by the names of the attributes that contain them in a file."""
        texts = {_PREFIX + each.name: getattr(self, each.name) for each in fields(self)}
        return {
            name: text if len(text) <= LONGEST else f"{text[: LONGEST - 3]}..."
            for name, text in texts.items()
        }


RESULT_ATTRIBUTES = tuple(_PREFIX + each.name for each in fields(Result))
"""columns or attributes of the results; the prefix distinguishes them from those of the file"""


@dataclass(frozen=True)
class Entry:
    """Row of a table, or object of a ReqIF file.

    Parameters
    ----------
    values
        Texts by the names of their attributes in lower case, without earlier results.
    line
        Its line.
    group
        Headings above it.
    is_heading
        Whether it is a heading unless it also has the text of a requirement.
    attachments
        Line and description of a binary attachment, by the name of the attribute in lower case.
    """

    values: Mapping[str, str]
    line: int
    group: str = ""
    is_heading: bool = False
    attachments: Mapping[str, tuple[int, str]] = field(default_factory=dict)


class RequirementsFile(ABC):
    """Content of a requirements file.

    Parameters
    ----------
    file
        Its path.
    """

    attribute = "attribute"
    """the format's word for an attribute"""

    candidates: Mapping[str, tuple[str, ...]]
    """usual attributes for each field of a requirement, the preferred one first"""

    def __init__(self, file: Path) -> None:
        self.file = file

    @property
    @abstractmethod
    def entries(self) -> Sequence[Entry]:
        """Entries in the order of the file."""

    @property
    @abstractmethod
    def attributes(self) -> Sequence[str]:
        """Names of all attributes."""

    @property
    @abstractmethod
    def head_line(self) -> int:
        """Line from which the names of the attributes come."""

    @abstractmethod
    def with_results(self, results: Mapping[int, Result]) -> bytes:
        """Return the file with results, by the number of the entry from 0.

        The results replace those of an earlier sign-off. Everything else remains unchanged.
        """


Edit = tuple[int, int, AnyStr]
"""start and end of a part, and its replacement"""


def spliced(content: AnyStr, edits: Iterable[Edit[AnyStr]]) -> AnyStr:
    """Return text or bytes with some parts replaced. The parts do not overlap.

    Examples
    --------
    >>> spliced("F < 2 N", [(7, 7, ";"), (2, 3, ">")])
    'F > 2 N;'
    """
    pieces: list[AnyStr] = []
    position = 0
    for start, end, replacement in sorted(edits, key=lambda edit: edit[:2]):
        pieces += [content[position:start], replacement]
        position = end
    pieces.append(content[position:])
    return content[:0].join(pieces)
