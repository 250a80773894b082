"""How a text table is written: separator, decimal mark, header, row of units; from its head."""

from __future__ import annotations

import codecs
import csv
import io
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from bywire.core.errors import FileError, UnitError, quoted
from bywire.data.column_units import split_title, unit_of

SEPARATORS = {"\t": "tab", ";": "semicolon", ",": "comma"}
"""what may stand between two cells, in the order in which it is looked for"""

HEAD = 1 << 18
"""bytes that are looked at; a header must end before"""

_ROWS = 200  # rows that are looked at for the decimal mark
_NUMBER = re.compile(r"[+-]?([0-9]+([.,][0-9]*)?|[.,][0-9]+)([eE][+-]?[0-9]+)?")
MISSING = ("", "nan", "NaN")
"""cells of what was not measured"""


@dataclass(frozen=True)
class Dialect:
    """How a text table is written.

    Parameters
    ----------
    separator
        What stands between two cells.
    decimal
        ``"."`` or ``","``; empty where the cells tell it, see `with_mark`.
    titles
        Titles of the columns; empty where there is no header.
    units
        Their units as written; empty texts where there are none.
    width
        Number of cells in a row.
    first_line
        Line of the first row of numbers, counted from 1.
    start
        Its first byte in the file.
    rows
        First rows of numbers.
    """

    separator: str
    decimal: str
    titles: tuple[str, ...]
    units: tuple[str, ...]
    width: int
    first_line: int
    start: int
    rows: tuple[str, ...]

    def label(self, column: int) -> str:
        """Return what errors call a column, counted from 0."""
        return self.titles[column] if self.titles else str(column + 1)


def dialect_of(path: Path, head: bytes, decimal: str, skip_lines: int) -> Dialect:
    """Return how a text table is written.

    Parameters
    ----------
    path
        What errors call it.
    head
        Its first bytes, up to ``HEAD``.
    decimal
        Decimal mark where it is known; else the head tells.
    skip_lines
        Lines before the table.

    Raises
    ------
    FileError
        When it is not UTF-8, has no row of numbers, or is not clear.
    """
    lines = _lines(path, head)
    at = skip_lines
    while at < len(lines) and not lines[at].strip():
        at += 1
    if at >= len(lines):
        raise FileError(f"{path} holds no row after {skip_lines} lines that are skipped")
    separator = separator_of(lines[at])
    first = _cells(path, lines[at], separator, at + 1)
    titles: tuple[str, ...] = ()
    units = [""] * len(first)
    if not _are_numbers(first):
        names = [split_title(cell) for cell in first]
        titles, units = tuple(n for n, _ in names), [u for _, u in names]
        at += 1
        row = _cells(path, lines[at], separator, at + 1) if at < len(lines) else []
        if row and any(row) and not _are_numbers(row) and _are_units(row):
            units = [_bare(cell) or unit for cell, unit in zip(row, units, strict=False)]
            at += 1
    width = len(first)
    while titles and not titles[-1] and not units[-1]:  # a separator ends every row
        titles, units = titles[:-1], units[:-1]
    if separator == "," and decimal == ",":
        raise FileError(f"{path}: a comma cannot separate columns and mark decimals: decimal = '.'")
    start = sum(len(line) for line in _raw_lines(head)[:at])
    if not start and head.startswith(codecs.BOM_UTF8):
        start = len(codecs.BOM_UTF8)
    mark = "." if separator == "," else decimal
    rows = tuple(lines[at : at + _ROWS])
    return Dialect(separator, mark, titles, tuple(units), width, at + 1, start, rows)


def _raw_lines(head: bytes) -> list[bytes]:
    return head.splitlines(keepends=True)


def _lines(path: Path, head: bytes) -> list[str]:
    """Return the complete lines of the head."""
    if b"\r" in head and b"\n" not in head:
        raise FileError(f"{path}: its lines end with a bare carriage return: save it with LF ends")
    if len(head) == HEAD:
        head = head[: head.rfind(b"\n") + 1]
        if not head:
            raise FileError(f"{path}, line 1: it is longer than {HEAD} bytes: is this a table?")
    try:
        return [line.decode("utf-8-sig").rstrip("\r\n") for line in _raw_lines(head)]
    except UnicodeDecodeError:
        number = next(k for k, line in enumerate(_raw_lines(head), 1) if not _is_text(line))
        raise FileError(
            f"{path}, line {number}: it is not UTF-8: save the file as text in UTF-8 (in "
            "spreadsheets: 'CSV UTF-8')"
        ) from None


def _is_text(line: bytes) -> bool:
    try:
        line.decode("utf-8")
    except UnicodeDecodeError:
        return False
    return True


def _cells(path: Path, line: str, separator: str, number: int) -> list[str]:
    try:
        rows = list(csv.reader(
            io.StringIO(line), delimiter=separator, strict=True, skipinitialspace=True
        ))
    except csv.Error as error:
        raise FileError(f"{path}, line {number}: {error}: check its quotation marks") from None
    return [cell.strip() for cell in rows[0]] if rows else []


def _are_numbers(cells: list[str]) -> bool:
    """Return whether a row is one of measured values: numbers and blanks, one number at least."""
    plain = [cell for cell in cells if cell not in MISSING]
    return bool(plain) and all(_NUMBER.fullmatch(cell) for cell in plain)


def _are_units(cells: list[str]) -> bool:
    return all(not cell or cell == "-" or _is_unit(_bare(cell)) for cell in cells)


def _bare(cell: str) -> str:
    """Return a unit without the brackets around it."""
    return cell[1:-1].strip() if cell[:1] in "[(" and cell[-1:] in "])" and cell else cell


def _is_unit(text: str) -> bool:
    try:
        unit_of(text)
    except UnitError:
        return False
    return True


def with_mark(path: Path, dialect: Dialect, indices: Sequence[int]) -> Dialect:
    """Return a dialect with the decimal mark of the first rows of some columns.

    Raises
    ------
    FileError
        When they have both: one may be a mark of thousands.
    """
    if dialect.decimal:
        return dialect
    first: dict[str, tuple[int, int, str]] = {}
    for number, line in enumerate(dialect.rows, dialect.first_line):
        cells = [cell.strip().strip('"') for cell in line.split(dialect.separator)]
        for k, cell in ((k, cells[k]) for k in indices if k < len(cells)):
            for mark in ",.":
                if mark in cell and _NUMBER.fullmatch(cell):
                    first.setdefault(mark, (number, k, cell))
    if len(first) == 2:
        before, (number, k, cell) = sorted(first.values())
        raise FileError(
            f"{path}, line {number}, column {quoted(dialect.label(k))}: {quoted(cell)} mixes "
            f"decimal comma and decimal point ({quoted(before[2])} in line {before[0]}), columns "
            f"separated by {SEPARATORS[dialect.separator]}: write all numbers with one of them, "
            "and none with a separator of thousands"
        )
    return replace(dialect, decimal=next(iter(first), "."))


def separator_of(first: str) -> str:
    """Return the separator of a table's first line; what stands in quotes does not count."""
    bare = re.sub(r'"[^"]*"', "", first)
    return next((mark for mark in SEPARATORS if mark in bare), ",")
