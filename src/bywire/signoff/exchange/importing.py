"""Import of requirements from a file of another tool."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bywire.core.errors import FileError, ParameterError, not_valid, quoted, unknown_of_few
from bywire.core.section import Section
from bywire.data.toml_file import limited_bytes
from bywire.signoff.exchange.csv_table import CsvTable
from bywire.signoff.exchange.reqif import ReqifFile
from bywire.signoff.exchange.requirements_file import LARGEST, Entry, RequirementsFile, Result
from bywire.signoff.statements import Place, Statement, placed, require_id

_FORMATS: Mapping[str, Callable[[Path, bytes], RequirementsFile]] = {
    ".csv": CsvTable,
    ".tsv": CsvTable,
    ".reqif": ReqifFile,
}
"""formats by suffix"""
_OTHERS = {
    ".reqifz": "Extract this archive, and specify the .reqif file in it",
    ".xlsx": "Save the sheet as 'CSV UTF-8'",
    ".xls": "Save the sheet as 'CSV UTF-8'",
}
_LISTED = re.compile(r"[,;\n]")


class AttributeNames(Section):
    """Section ``[attributes]``: names of columns or attributes that differ from the usual ones."""

    id: str = ""
    text: str = ""
    source: str = ""
    group: str = ""
    assumes: str = ""


@dataclass(frozen=True)
class Imported:
    """Requirements of a file.

    Parameters
    ----------
    content
        The file.
    statements
        Its requirements.
    numbers
        Number of the entry of each requirement, by id.
    digest
        SHA-256 digest of the file.
    """

    content: RequirementsFile
    statements: tuple[Statement, ...]
    numbers: Mapping[str, int]
    digest: str

    @property
    def file(self) -> Path:
        """Its path."""
        return self.content.file

    @property
    def results_name(self) -> str:
        """Name of the copy with results, which differs from that of the file."""
        return f"{self.file.stem}-verdicts{self.file.suffix}"

    def with_results(self, results: Mapping[str, Result]) -> bytes:
        """Return the file with results by id. Everything else in the file remains unchanged."""
        return self.content.with_results(
            {self.numbers[id]: result for id, result in results.items() if id in self.numbers}
        )


def imported_from(file: Path, names: AttributeNames, only: Mapping[str, Any]) -> Imported:
    """Read the requirements of a file.

    Parameters
    ----------
    file
        The file, whose suffix determines its format.
    names
        Names of attributes, where they are not the usual ones.
    only
        Values of attributes that only requirements have, for files that contain other entries.

    Raises
    ------
    InputError
        With file and line.
    """
    suffix = file.suffix.lower()
    if suffix not in _FORMATS:
        valid = ", ".join(_FORMATS)
        advice = _OTHERS.get(suffix, "Export the requirements in one of these formats")
        raise FileError(
            f"bywire cannot read requirements from {file}. Valid suffixes are {valid}. {advice}",
            name="requirements",
            value=suffix,
            valid=valid,
        )
    data = limited_bytes(file, "requirements file", LARGEST)
    content = _FORMATS[suffix](file, data)
    read = _Reader(content, names, only)
    found = list(read.statements())
    if not found:
        raise ParameterError(
            f"{file} contains no requirement. Add a requirement, or correct [only]",
            name="requirements",
        )
    numbers: dict[str, int] = {}
    for number, each in found:
        numbers.setdefault(each.id, number)
    return Imported(
        content,
        tuple(each for _, each in found),
        numbers,
        hashlib.sha256(data).hexdigest(),
    )


class _Reader:
    """Entries of a file as statements."""

    def __init__(
        self, content: RequirementsFile, names: AttributeNames, only: Mapping[str, Any]
    ) -> None:
        self._content = content
        self._known = {each.casefold(): each for each in content.attributes}
        self._names = {
            field: self._chosen(field, getattr(names, field))
            for field in AttributeNames.model_fields
        }
        self._only = {self._attribute(key, "[only]"): _values(key, only[key]) for key in only}

    def _chosen(self, field: str, name: str) -> tuple[str, ...]:
        """Return the names of a field's attributes in the file, the preferred one first."""
        if name:
            return (self._attribute(name, f"[attributes] {field}"),)
        usual = self._content.candidates[field]
        names = [name for each in usual if (name := each.casefold()) in self._known]
        if not names and field in ("id", "text"):
            missing = unknown_of_few(self._content.attribute, usual[0], self._known.values())
            raise missing.reworded(
                f"{self._head}: the file has no {self._content.attribute} {usual[0]!r}. Specify "
                f"another {self._content.attribute} in the section [attributes] of the sign-off "
                f"file, for example {field} = {next(iter(self._known.values()), 'NAME')!r}. Valid "
                f"names are {missing.valid}"
            )
        return tuple(names)

    def _attribute(self, name: str, where: str) -> str:
        """Return a name in lower case, under which entries store their values."""
        if name.casefold() not in self._known:
            error = unknown_of_few(
                f"{self._content.attribute} in {where}", name, self._known.values()
            )
            raise error.reworded(f"{self._head}: {error}")
        return name.casefold()

    @property
    def _head(self) -> Place:
        return Place(self._content.file, self._content.head_line)

    def statements(self) -> Iterator[tuple[int, Statement]]:
        """Yield the requirements with the numbers of their entries."""
        for number, each in enumerate(self._content.entries):
            if all(
                each.values.get(key, "").strip().casefold() in values
                for key, values in self._only.items()
            ):
                statement = self._statement(each)
                if statement is not None:
                    yield number, statement

    def _statement(self, entry: Entry) -> Statement | None:
        """Return the requirement of an entry; None if the entry is only a heading."""
        usual = self._names["text"]
        text = self._field(entry, "text", usual[:1] if entry.is_heading else usual)
        if not text and entry.is_heading:
            return None
        id = self._field(entry, "id", self._names["id"])
        place = Place(self._content.file, entry.line)
        with placed(place):
            self._require("id", id)
            self._require("text", text)
            require_id(id)
        return Statement(
            id,
            text,
            self._field(entry, "source", self._names["source"]),
            self._field(entry, "group", self._names["group"]) or entry.group,
            tuple(
                name
                for each in _LISTED.split(self._field(entry, "assumes", self._names["assumes"]))
                if (name := each.strip())
            ),
            place=place,
        )

    def _require(self, field: str, value: str) -> None:
        if not value:
            name = self._known[self._names[field][0]]
            raise ParameterError(
                f"{self._content.attribute} {name!r} is empty. Each requirement "
                "needs an id and a text. If this entry is not a requirement, exclude it with "
                "[only] in the sign-off file",
                name=field,
            )

    def _field(self, entry: Entry, field: str, names: tuple[str, ...]) -> str:
        for name in names:
            if name in entry.attachments:
                line, what = entry.attachments[name]
                attribute = self._known[name]
                raise FileError(
                    f"{Place(self._content.file, line)}: {attribute!r} contains a binary "
                    f"attachment ({what}), which bywire cannot read. Describe the attachment in "
                    "words, or export the file without it",
                    name=attribute,
                    value=what,
                )
            if text := entry.values.get(name, "").strip():
                return text
        return ""


def _values(key: str, value: Any) -> frozenset[str]:
    values = [value] if isinstance(value, str) else value
    if not isinstance(values, list) or not all(isinstance(each, str) for each in values):
        raise not_valid(f"[only] {key}", quoted(value), "a string or a list of strings")
    return frozenset(each.strip().casefold() for each in values)
