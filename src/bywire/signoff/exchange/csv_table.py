"""CSV: a table with one requirement per row, from a spreadsheet or another tool."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from bywire.core.errors import FileError, ParameterError, counted, quoted
from bywire.signoff.exchange.requirements_file import (
    RESULT_ATTRIBUTES,
    Edit,
    Entry,
    RequirementsFile,
    Result,
    spliced,
)

_SEPARATORS = {";": "semicolon", ",": "comma", "\t": "tab"}
_QUOTED = re.compile(r'"[^"]*(?:""[^"]*)*"')
_NEWLINE = re.compile(r"\r\n|\n|\r")
_SEP_LINE = re.compile(r"sep=(.)(?:\r\n|\n|\r)", re.IGNORECASE)  # of Excel
_MARK = "\ufeff"
_FORMULA = tuple("=+-@\uff1d\uff0b\uff0d\uff20")  # also in full width, as in Japanese spreadsheets
_MOST = 1000  # columns
_NAMES = ("id", "text", "source", "group", "assumes")


@dataclass(frozen=True)
class _Cell:
    start: int
    end: int
    text: str


@dataclass(frozen=True)
class _Row:
    cells: tuple[_Cell, ...]
    line: int

    @property
    def is_blank(self) -> bool:
        return not any(cell.text.strip() for cell in self.cells)


class CsvTable(RequirementsFile):
    """Table whose first row contains the column names.

    Parameters
    ----------
    file
        Its path, for errors.
    content
        Its bytes: UTF-8 with or without byte-order mark. Cells are separated by semicolons, commas
        or tabs, and quoted cells may contain line breaks.

    Raises
    ------
    FileError
        With file and line, if it is not such a table.
    """

    attribute = "column"
    candidates: Mapping[str, tuple[str, ...]] = {name: (name,) for name in _NAMES}

    def __init__(self, file: Path, content: bytes) -> None:
        super().__init__(file)
        self._text = _decoded(file, content)
        start, self._separator = self._layout()
        rows = [row for row in self._rows(start, self._separator) if not row.is_blank]
        if not rows:
            raise FileError(
                f"{file}, line 1: the table is empty. Its first row must contain the column names, "
                "such as id and text",
                name=str(file),
            )
        self._head, self._body = rows[0], rows[1:]
        self._titles = [cell.text.strip() for cell in self._head.cells]
        self._columns = self._columns_by_title()
        for row in self._body:
            self._require_width(row)

    @property
    def head_line(self) -> int:
        """Line of the first row."""
        return self._head.line

    @property
    def attributes(self) -> Sequence[str]:
        """Titles of the columns."""
        return [title for title in self._titles if title]

    @cached_property
    def entries(self) -> Sequence[Entry]:
        """Rows that are not blank."""
        columns = [each for each in self._columns.items() if each[0] not in RESULT_ATTRIBUTES]
        return [
            Entry({name: row.cells[k].text for name, k in columns if k < len(row.cells)}, row.line)
            for row in self._body
        ]

    def with_results(self, results: Mapping[int, Result]) -> bytes:
        """Return the table with results in separate columns. New columns come last."""
        edits = self._edits(self._head, {name: name for name in RESULT_ATTRIBUTES})
        for k, row in enumerate(self._body):
            texts = results[k].by_attribute() if k in results else {}
            cells = {name: _harmless(texts.get(name, "")) for name in RESULT_ATTRIBUTES}
            edits += self._edits(row, cells)
        return spliced(self._text, edits).encode("utf-8", "replace")

    def _edits(self, row: _Row, cells: Mapping[str, str]) -> list[Edit[str]]:
        """Return the changes of a row, in which cells may be missing at the end."""
        edits, added = [], [""] * max(0, len(self._titles) - len(row.cells))
        for name, text in cells.items():
            written = self._written(text)
            k = self._columns.get(name)
            if k is None:
                added.append(written)
            elif k < len(row.cells):
                edits.append((row.cells[k].start, row.cells[k].end, written))
            else:
                added[k - len(row.cells)] = written
        if added:
            # Beyond the titles, there are only empty cells.
            end = row.cells[min(len(row.cells), len(self._titles)) - 1].end
            edits.append((end, end, "".join(self._separator + text for text in added)))
        return edits

    def _written(self, text: str) -> str:
        if any(mark in text for mark in (self._separator, '"', "\n", "\r")):
            return '"' + text.replace('"', '""') + '"'
        return text

    # --- Layout

    def _layout(self) -> tuple[int, str]:
        """Return the start of the first row, and the separator of cells."""
        start = len(_MARK) if self._text.startswith(_MARK) else 0
        named = _SEP_LINE.match(self._text, start)
        if named is not None and named[1] in _SEPARATORS:
            return named.end(), named[1]
        line = _NEWLINE.split(self._text[start:], maxsplit=1)[0].casefold()

        def fit(separator: str) -> tuple[int, int]:
            titles = {title.strip(' "') for title in line.split(separator)}
            return len(titles.intersection(_NAMES)), line.count(separator)

        return start, max(_SEPARATORS, key=fit)

    def _rows(self, position: int, separator: str) -> Iterator[_Row]:
        """Yield rows with the places of their cells, which the module csv does not report."""
        text, plain = self._text, re.compile(rf"[^\r\n{separator}]*")
        line = 1 + len(_NEWLINE.findall(text, 0, position))
        while position < len(text):
            cells: list[_Cell] = []
            first_line = line
            while not cells or text[position : position + 1] == separator:
                position += bool(cells)
                cell = self._quoted(position, line, separator) or plain.match(text, position)
                assert cell is not None
                line += len(_NEWLINE.findall(cell[0]))
                content = cell[0]
                if content.startswith('"'):
                    content = content[1:-1].replace('""', '"')
                cells.append(_Cell(position, cell.end(), content))
                position = cell.end()
            yield _Row(tuple(cells), first_line)
            end = _NEWLINE.match(text, position)
            position, line = (end.end() if end else position), line + 1

    def _quoted(self, position: int, line: int, separator: str) -> re.Match[str] | None:
        """Return the quoted cell at a position; None if the cell is not quoted."""
        if self._text[position : position + 1] != '"':
            return None
        cell = _QUOTED.match(self._text, position)
        if cell is None:
            raise FileError(
                f"{self.file}, line {line}: a quoted cell begins here, but its closing quotation "
                "mark is missing. Add it, or remove the opening quotation mark",
                name=str(self.file),
            )
        after = self._text[cell.end() : cell.end() + 1]
        if after and after not in (separator, "\r", "\n"):
            line += len(_NEWLINE.findall(cell[0]))
            raise FileError(
                f"{self.file}, line {line}: {quoted(after)} follows a closing quotation mark. "
                "Double each quotation mark inside a quoted cell",
                name=str(self.file),
                value=quoted(after),
            )
        return cell

    def _columns_by_title(self) -> dict[str, int]:
        """Return the number of each column that has a title."""
        place, width = f"{self.file}, line {self.head_line}", len(self._titles)
        if width > _MOST:
            raise FileError(
                f"{place}: the table has {width} columns, but bywire reads at most {_MOST}. Remove "
                "some of them",
                name=str(self.file),
                value=str(width),
                valid=f"at most {_MOST}",
            )
        columns: dict[str, int] = {}
        for k, title in enumerate(map(str.casefold, self._titles)):
            if title and columns.setdefault(title, k) != k:
                raise ParameterError(
                    f"{place}: two columns are named {quoted(title)}. Rename one of them",
                    name="column",
                    value=title,
                )
        return columns

    def _require_width(self, row: _Row) -> None:
        width = len(self._titles)
        if any(cell.text.strip() for cell in row.cells[width:]):
            raise FileError(
                f"{self.file}, line {row.line}: this row has {counted(len(row.cells), 'cell')}, "
                f"but the first row has {width} (separator: {_SEPARATORS[self._separator]}). Put "
                "text that contains the separator in quotation marks",
                name=str(self.file),
                value=str(len(row.cells)),
                valid=str(width),
            )


def _decoded(file: Path, content: bytes) -> str:
    try:
        text = content.decode("utf-8")
    except UnicodeDecodeError as error:
        line = 1 + content[: error.start].count(b"\n")
        raise FileError(
            f"{file}, line {line} is not UTF-8 text. Save the table again (in a spreadsheet: as "
            "'CSV UTF-8')",
            name=str(file),
            valid="UTF-8",
        ) from None
    if "\0" in text:
        line = 1 + text[: text.index("\0")].count("\n")
        raise FileError(
            f"{file}, line {line} contains a null character, so the file is not a CSV table. Save "
            "the table as CSV",
            name=str(file),
        )
    return text


def _harmless(text: str) -> str:
    """Return text with an apostrophe if a spreadsheet would interpret the text as a formula."""
    return f"'{text}" if text.lstrip().startswith(_FORMULA) else text
