"""How a text table is written: separator, decimal mark, header, row of units; from its head."""

from __future__ import annotations

import codecs
import csv
import io
import re
from dataclasses import dataclass
from pathlib import Path

from bywire.core.errors import FileError, quoted
from bywire.data.column_units import split_title, unit_of
from bywire.data.text_table import SEPARATORS, separator_of

HEAD = 1 << 18
"""bytes that are looked at; a header must end before"""

_ROWS = 200  # rows that are looked at for the decimal mark
_NUMBER = re.compile(r"[+-]?([0-9]+([.,][0-9]*)?|[.,][0-9]+)([eE][+-]?[0-9]+)?")
_MISSING = ("", "nan", "NaN")


@dataclass(frozen=True)
class Dialect:
    """How a text table is written.

    Parameters
    ----------
    separator
        What stands between two cells.
    decimal
        ``"."`` or ``","``.
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
    """

    separator: str
    decimal: str
    titles: tuple[str, ...]
    units: tuple[str, ...]
    width: int
    first_line: int
    start: int


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
    mark = decimal or _decimal(path, lines[at : at + _ROWS], separator)
    return Dialect(separator, mark, titles, tuple(units), width, at + 1, start)


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
        found = list(csv.reader(io.StringIO(line), delimiter=separator, strict=True))
    except csv.Error as error:
        raise FileError(f"{path}, line {number}: {error}: check its quotation marks") from None
    return [cell.strip() for cell in found[0]] if found else []


def _are_numbers(cells: list[str]) -> bool:
    """Return whether a row is one of measured values: numbers and blanks, one number at least."""
    plain = [cell for cell in cells if cell not in _MISSING]
    return bool(plain) and all(_NUMBER.fullmatch(cell) for cell in plain)


def _are_units(cells: list[str]) -> bool:
    return all(not cell or cell == "-" or _is_unit(_bare(cell)) for cell in cells)


def _bare(cell: str) -> str:
    """Return a unit without the brackets around it."""
    return cell[1:-1].strip() if cell[:1] in "[(" and cell[-1:] in "])" and cell else cell


def _is_unit(text: str) -> bool:
    try:
        unit_of(text)
    except ValueError:
        return False
    return True


def _decimal(path: Path, lines: list[str], separator: str) -> str:
    """Return the decimal mark of the first rows."""
    if separator == ",":
        return "."
    cells = [cell.strip().strip('"') for line in lines for cell in line.split(separator)]
    numbers = [cell for cell in cells if _NUMBER.fullmatch(cell)]
    marks = {mark for mark in ",." if any(mark in cell for cell in numbers)}
    if len(marks) == 2:
        mixed = [next(c for c in numbers if mark in c) for mark in ",."]
        raise FileError(
            f"{path} mixes decimal comma and decimal point ({quoted(mixed[0])}, "
            f"{quoted(mixed[1])}), columns separated by {SEPARATORS[separator]}: write all numbers "
            "with one of them, and none with a separator of thousands"
        )
    return marks.pop() if marks else "."
