"""Layout of a text table, detected from its head: separator, decimal mark, header, units."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from bywire.core.errors import FileError, UnitError, quoted
from bywire.data.column_units import split_title, unit_of
from bywire.data.file_format import ReadOptions
from bywire.data.text_encoding import head_text
from bywire.data.time_stamps import DIGITS, is_stamp, kind_of_stamps

SEPARATORS = {"\t": "tab", ";": "semicolon", ",": "comma", " ": "spaces"}
"""separators of cells, in the order of the search"""

HEAD = 1 << 18
"""bytes of the head, in which a header must end"""

_MARKS = (
    "- -- --- nan -nan nan(ind) -nan(ind) 1.#qnan 1.#ind -1.#ind 1.#inf -1.#inf na n/a n.a. #n/a "
    "#na #num! #value! #div/0! null inf +inf -inf infinity +infinity -infinity ∞ +∞ -∞ ovld ol o.l "
    "overload overrange missing invalid sna"
)
MARKS = frozenset(("", *_MARKS.split()))
"""cells that mark missing values, in lower case"""

COMMENTS = ("#", "%", "//", "!")
"""first characters of a comment line"""

NUMBER, TEXT, UNCLEAR = "number", "text", "time in an ambiguous order"
"""kinds of columns, in addition to those of time stamps"""

_ROWS = 200  # rows used to detect the decimal mark and the kinds of columns
_LINES = 2000  # searched for the first row of numbers
_NUMBER = re.compile(r"[+-]?([0-9]+([.,][0-9]*)?|[.,][0-9]+)([eE][+-]?[0-9]+)?")
_BEGINS_LIKE_ONE = re.compile(r"[+-]?[.,]?[0-9]")  # a wrong number rather than text
_SEP_LINE = re.compile(r'"?sep=(.)"?', re.IGNORECASE)
_SPACED_UNIT = re.compile(r" +(?=[\[(][^\])]*[\])])")  # "t [s]  p [bar]" has two cells


@dataclass(frozen=True)
class Dialect:
    """Dialect of a text table.

    Parameters
    ----------
    separator
        Separator of cells.
    decimal
        ``"."`` or ``","``; empty if the cells determine it (see `with_mark`).
    titles
        Titles of the columns; empty without a header.
    units
        Their units as written; empty texts if there are none.
    width
        Number of cells in a row.
    first_line
        Line of the first row of numbers, counted from 1.
    start
        Its first byte in the file, as UTF-8.
    rows
        First rows of numbers.
    kinds
        Kind of each column's cells: `NUMBER`, `TEXT`, or a kind of time stamps.
    encoding
        Encoding of the file.
    marks
        Additional cells that mark missing values.
    raster
        First time and step [s], if there is no time column.
    clocks
        Time columns of other columns, by column from 0, if the file defines them.
    is_ragged
        Whether cells may be missing at the end of a row.
    notes
        Notes on how the table is read.
    """

    separator: str
    decimal: str
    titles: tuple[str, ...]
    units: tuple[str, ...]
    width: int
    first_line: int
    start: int
    rows: tuple[str, ...]
    kinds: tuple[str, ...] = ()
    encoding: str = "utf-8"
    marks: frozenset[str] = frozenset()
    raster: tuple[float, float] | None = None
    clocks: dict[int, int] = field(default_factory=dict)
    is_ragged: bool = False
    notes: tuple[str, ...] = ()

    def label(self, column: int) -> str:
        """Return the name of a column, counted from 0, in errors."""
        return self.titles[column] if column < len(self.titles) else str(column + 1)

    def is_mark(self, cell: str) -> bool:
        """Return whether a cell marks a missing value."""
        return cell.casefold() in MARKS or cell in self.marks


@dataclass(frozen=True)
class Head:
    """The first lines of a text table.

    Parameters
    ----------
    path
        Path of the file, for errors.
    lines
        Its complete lines, with their line endings.
    encoding
        Its encoding.
    options
        Options of the user.
    """

    path: Path
    lines: list[str]
    encoding: str
    options: ReadOptions

    def start(self, line: int) -> int:
        """Return the first byte of a line, counted from 0, as UTF-8."""
        return sum(len(text.encode()) for text in self.lines[:line])

    def plain(self, line: int) -> str:
        """Return a line without its line ending."""
        return self.lines[line].rstrip("\r\n")

    def is_blank(self, line: int) -> bool:
        """Return whether a line is blank."""
        return not self.lines[line].strip()

    def cells(self, line: int, separator: str) -> list[str]:
        """Return the cells of a line.

        Raises
        ------
        FileError
            When its quotation marks are not valid.
        """
        try:
            return cells_of(self.plain(line), separator)
        except csv.Error as error:
            raise FileError(
                f"{self.path}, line {line + 1}: {error}. Check its quotation marks",
                name=str(self.path),
            ) from None

    def table(
        self, separator: str, titles: Sequence[str], units: Sequence[str], at: int, width: int
    ) -> Dialect:
        """Return the dialect of a table whose first row of numbers is known."""
        rows = tuple(self.plain(k) for k in range(at, min(at + _ROWS, len(self.lines))))
        decimal = "." if separator == "," else self.options.decimal
        marks = frozenset(mark for mark in self.options.missing if mark)
        dialect = Dialect(
            separator,
            decimal,
            tuple(titles),
            tuple(units),
            width,
            at + 1,
            self.start(at),
            rows,
            encoding=self.encoding,
            marks=marks,
        )
        return replace(dialect, kinds=_kinds(dialect))


def head_of_table(path: Path, options: ReadOptions) -> Head:
    """Return the first lines of a text table.

    Raises
    ------
    FileError
        When they are not text in the specified encoding, in UTF-8 or in Windows encoding.
    """
    return Head(path, *head_text(path, options.encoding, HEAD), options)


def dialect_of(head: Head) -> Dialect:
    """Detect the dialect of a text table.

    The table consists of the first row of numbers and all rows after it, and of the rows of titles
    and units before it. bywire skips earlier lines with a note, unless they also contain numbers.

    Raises
    ------
    FileError
        When it has no row, or is ambiguous.
    """
    options, path = head.options, head.path
    at, chosen = options.skip_lines, ""
    while at < len(head.lines) and head.is_blank(at):
        at += 1
    if at < len(head.lines) and (match := _SEP_LINE.fullmatch(head.plain(at).strip())):
        at, chosen = at + 1, match[1]
    first = _first_row_of_numbers(head, at, [chosen] if chosen else list(SEPARATORS))
    begin = at
    while begin < len(head.lines) and (head.is_blank(begin) or _is_comment(head.plain(begin))):
        begin += 1
    if begin >= len(head.lines):
        raise FileError(
            f"{path} has no rows after {options.skip_lines} skipped lines", name=str(path)
        )
    if chosen and chosen not in SEPARATORS:
        raise FileError(
            f"{path}: the separator {quoted(chosen)} in the first line is not valid. Use ';'",
            name=str(path),
            value=quoted(chosen),
            valid="';'",
        )
    dialect = None
    if first is not None and options.titles is None:
        dialect, begin = _from_numbers(head, at, begin, *first)
    if dialect is None:
        separator = chosen or (first[0] if first else _separator_of(head, begin))
        dialect = _headed(head, begin, separator, options.titles)
    if dialect.separator == "," and options.decimal == ",":
        raise FileError(
            f"{path}: a comma cannot be both column separator and decimal mark. Set decimal = '.'",
            name="decimal",
        )
    before = [k for k in range(at, begin) if not head.is_blank(k)]
    if before:
        first_line = f"line {before[0] + 1} ({quoted(head.plain(before[0]).strip())})"
        note = f"bywire skips {first_line} before the table"
        if len(before) > 1:
            note = (
                f"bywire skips {len(before)} lines before the table, from {first_line} "
                f"to {before[-1] + 1}"
            )
        dialect = replace(dialect, notes=(note, *dialect.notes))
    return dialect


def _separator_of(head: Head, at: int) -> str:
    """Return the separator of a line other than a row of numbers, ignoring quotes."""
    bare = re.sub(r'"[^"]*"', "", head.plain(at))
    found = next((mark for mark in "\t;," if mark in bare), "")
    if found:
        return found
    following = [head.cells(k, " ") for k in range(at, len(head.lines)) if not head.is_blank(k)][:5]
    widths = {len(cells) for cells in following}
    return " " if len(widths) == 1 and widths != {1} and len(following) > 1 else ","


def cells_of(line: str, separator: str) -> list[str]:
    """Return the cells of a line; raise csv.Error if its quotation marks are not valid."""
    if separator == " ":
        line = _SPACED_UNIT.sub("", " ".join(line.split()))
    rows = list(
        csv.reader(io.StringIO(line), delimiter=separator, strict=True, skipinitialspace=True)
    )
    return [cell.strip() for cell in rows[0]] if rows else []


def with_mark(path: Path, dialect: Dialect, indices: Sequence[int]) -> Dialect:
    """Return a dialect with the decimal mark of the first rows of some columns.

    Raises
    ------
    FileError
        When they contain both marks, since one may be a thousands separator.
    """
    if dialect.decimal:
        return dialect
    first: dict[str, tuple[int, int, str]] = {}
    for number, line in enumerate(dialect.rows, dialect.first_line):
        split = line.split() if dialect.separator == " " else line.split(dialect.separator)
        cells = [cell.strip().strip('"') for cell in split]
        for k, cell in ((k, cells[k]) for k in indices if k < len(cells)):
            for mark in ",.":
                if mark in cell and _NUMBER.fullmatch(cell):
                    first.setdefault(mark, (number, k, cell))
    if len(first) == 2:
        before, (number, k, cell) = sorted(first.values())
        raise FileError(
            f"{path}, line {number}, column {quoted(dialect.label(k))}: {quoted(cell)} mixes "
            f"decimal comma and decimal point ({quoted(before[2])} in line {before[0]}). Columns "
            f"are separated by {SEPARATORS[dialect.separator]}. Use one decimal mark for all "
            "numbers, and no thousands separator",
            name=dialect.label(k),
            value=quoted(cell),
        )
    return replace(dialect, decimal=next(iter(first), "."))


def _first_row_of_numbers(head: Head, at: int, separators: list[str]) -> tuple[str, int] | None:
    """Return the separator and the line of the first row of two numbers or more."""
    for separator in separators:
        for line in range(at, min(at + _LINES, len(head.lines))):
            if separator != " " and separator not in head.lines[line]:
                continue
            try:
                cells = cells_of(head.plain(line), separator)
            except csv.Error:
                if _is_comment(head.plain(line)):
                    continue
                break  # the row reader reports the place
            if _are_numbers(cells, head.options.missing) and len(_bare_row(cells)) > 1:
                return separator, line
    return None


def _bare_row(cells: list[str]) -> list[str]:
    """Return the cells of a row without the empty ones at its end."""
    while cells and not cells[-1]:
        cells = cells[:-1]
    return cells


def _are_numbers(cells: list[str], marks: Sequence[str] = ()) -> bool:
    """Return whether a row contains measured values: numbers, times, marks of missing values."""
    plain = [cell for cell in cells if cell.casefold() not in MARKS and cell not in marks]
    return bool(plain) and all(_NUMBER.fullmatch(cell) or is_stamp(cell) for cell in plain)


def _has_number(cells: list[str]) -> bool:
    return any(_NUMBER.fullmatch(cell) or is_stamp(cell) for cell in cells)


def _from_numbers(
    head: Head, at: int, begin: int, separator: str, first: int
) -> tuple[Dialect | None, int]:
    """Return the dialect of a table by its first row of numbers, and the line of its titles.

    None if an earlier row has the same number of cells and contains a number, since it may belong
    to the table.
    """
    row = head.cells(first, separator)
    width = len(_bare_row(row))
    above = [k for k in range(at, first) if not head.is_blank(k)]
    rows = {k: _loose_cells(head, k, separator) for k in above}
    alike = [k for k in above[-2:] if len(_bare_row(rows[k])) in (width, len(row))]
    titles: list[str] = []
    units = [""] * len(row)
    notes: list[str] = []
    start = first
    if alike and alike[-1] == above[-1]:
        has_units = len(alike) == 2 and (
            _are_units(rows[alike[-1]])
            or _known_units(rows[alike[-1]]) > max(_known_units(rows[alike[-2]]), width / 2)
        )
        start = alike[-2] if has_units else alike[-1]
        titles, units = _titles_of(rows[start], rows[alike[-1]] if has_units else [])
        notes += _doubtful_titles(titles, start)
        if _is_comment(head.plain(start)):
            notes.append(f"bywire reads the comment in line {start + 1} as column titles")
    elif above and _has_decimal_commas(head, first, separator, width, rows[above[-1]]):
        raise FileError(
            f"{head.path}, line {first + 1}: commas separate the columns and are also decimal "
            f"marks, because the {len(rows[above[-1]])} column titles above have {width} cells "
            "below. Export the table with semicolons or decimal points",
            name=str(head.path),
        )
    elif above and above[-1] == begin:
        return None, begin  # a header that does not match the rows
    elif above and start > begin:
        notes.append(
            f"line {above[-1] + 1} does not match the rows below it, so the columns have no titles "
            "and their names are 1, 2, ..."
        )
    # Sentences also contain blanks; with this separator, a row must start with a number.
    first_ones = 1 if separator == " " else None
    mixed = (k for k in above if len(rows[k]) == len(row) and _has_number(rows[k][:first_ones]))
    has_titles = sum(bool(unit) and _is_unit(unit) for unit in units) > width / 2
    if any((k < start and not has_titles) or k == start != begin for k in mixed):
        return None, begin
    dialect = head.table(separator, titles, units, first, len(row))
    return replace(dialect, notes=tuple(notes)), start


def _has_decimal_commas(
    head: Head, first: int, separator: str, width: int, titles: list[str]
) -> bool:
    """Return whether each number has two cells, because commas are also its decimal mark."""
    if separator != "," or 2 * len(titles) != width or _has_number(titles):
        return False
    rows = (head.cells(k, ",") for k in range(first, min(first + _ROWS, len(head.lines))))
    return all(
        len(cells) == width and all(cell.isdecimal() for cell in cells[1::2])
        for cells in rows
        if cells
    )


def _loose_cells(head: Head, line: int, separator: str) -> list[str]:
    try:
        return cells_of(head.plain(line), separator)
    except csv.Error:
        return [head.plain(line)]


def _doubtful_titles(titles: list[str], line: int) -> list[str]:
    """Return a note on numbers among the titles."""
    number = next((title for title in titles if _has_number([title])), None)
    if number is None:
        return []
    return [
        f"bywire reads line {line + 1} as column titles although it contains numbers "
        f"({quoted(number)}). Set titles = false in the mapping to read it as a row"
    ]


def _headed(head: Head, at: int, separator: str, titles: bool | None) -> Dialect:
    """Return the dialect of a table that begins in a line: with titles, or a row of numbers."""
    first = head.cells(at, separator)
    names: list[str] = []
    units = [""] * len(first)
    notes: list[str] = []
    if titles or (titles is None and not _are_numbers(first, head.options.missing)):
        below = at + 1
        while below < len(head.lines) and head.is_blank(below):
            below += 1
        row = head.cells(below, separator) if below < len(head.lines) else []
        is_units = any(row) and not _are_numbers(row) and _are_units(row)
        names, units = _titles_of(first, row if is_units else [])
        notes = [] if titles else _doubtful_titles(names, at)
        at = below + 1 if is_units else at + 1
    return replace(head.table(separator, names, units, at, len(first)), notes=tuple(notes))


def _titles_of(first: list[str], below: list[str]) -> tuple[list[str], list[str]]:
    """Return titles and units from a row of titles and an optional row of units."""
    names = [split_title(cell.lstrip("#% ") if k == 0 else cell) for k, cell in enumerate(first)]
    titles, units = [name for name, _ in names], [unit for _, unit in names]
    for k, cell in enumerate(below[: len(units)]):
        units[k] = _bare(cell) or units[k]
    while titles and not titles[-1] and not units[-1]:  # a separator ends every row
        titles, units = titles[:-1], units[:-1]
    return titles, units


def _is_comment(line: str) -> bool:
    return line.lstrip().startswith(COMMENTS)


def _are_units(cells: list[str]) -> bool:
    """Return whether a row contains units: all cells, or most and the others in brackets."""
    plain = [cell for cell in cells if cell and cell != "-"]
    known = [cell for cell in plain if _is_unit(_bare(cell))]
    return len(known) == len(plain) or (
        2 * len(known) > len(plain) and all(c in known or _bare(c) != c for c in plain)
    )


def _known_units(cells: list[str]) -> int:
    """Return the number of units in a row."""
    return sum(bool(cell) and _is_unit(_bare(cell)) for cell in cells)


def _bare(cell: str) -> str:
    """Return a unit without the brackets around it."""
    return cell[1:-1].strip() if cell[:1] in "[(" and cell[-1:] in "])" and cell else cell


def _is_unit(text: str) -> bool:
    try:
        unit_of(text)
    except UnitError:
        return text in ("g", "C", "F")
    return True


def _kinds(dialect: Dialect) -> tuple[str, ...]:
    """Return the kind of each column's cells from the first rows."""
    columns: list[list[str]] = [[] for _ in range(dialect.width)]
    for line in dialect.rows:
        if _is_comment(line):
            continue
        try:
            cells = cells_of(line, dialect.separator)
        except csv.Error:
            continue
        for k, cell in enumerate(cells[: dialect.width]):
            if not dialect.is_mark(cell):
                columns[k].append(cell)
    return tuple(_kind(cells) for cells in columns)


def _kind(cells: list[str]) -> str:
    if not cells or any(_NUMBER.fullmatch(cell) for cell in cells):
        return NUMBER
    kind = kind_of_stamps(cells)
    if not kind and all(is_stamp(cell) for cell in cells):
        return UNCLEAR
    return kind or (NUMBER if any(_BEGINS_LIKE_ONE.match(cell) for cell in cells) else TEXT)


# --- Files with a description before the table: LabVIEW (LVM) and VBOX

_LVM_MARK = "LabVIEW Measurement"
END_OF_HEADER = "***End_of_Header***"
_VBOX_MARK = "[column names]"

_LVM_SEPARATORS = {"Tab": "\t", "Comma": ",", "Semicolon": ";", "Space": " "}
_VBOX_UNITS = {
    "sats": "1",
    "satellites": "1",
    "lat": "arcmin",
    "latitude": "arcmin",
    "long": "arcmin",
    "longitude": "arcmin",
    "velocity": "km/h",
    "heading": "deg",
    "height": "m",
}
"""units of a VBOX's standard columns, from the manufacturer's file description"""


def layout_of(head: Head) -> Dialect | None:
    """Return the dialect of a LabVIEW or VBOX file; None for other files.

    Raises
    ------
    FileError
        When its description is inconsistent.
    """
    if head.lines and head.lines[0].startswith(_LVM_MARK):
        return _lvm(head)
    if any(line.strip().casefold() == _VBOX_MARK for line in head.lines):
        return _vbox(head)
    return None


def _lvm(head: Head) -> Dialect:
    separator, entries = "\t", {}
    ends = [k for k in range(len(head.lines)) if head.lines[k].startswith(END_OF_HEADER)]
    if len(ends) < 2:
        raise FileError(
            f"{head.path} is a LabVIEW file without a table, because its header has no second line "
            f"{END_OF_HEADER!r}",
            name=str(head.path),
        )
    for k in range(ends[1]):
        words = head.plain(k).replace(",", "\t").replace(";", "\t").split("\t")
        if words[0] == "Separator" and len(words) > 1:
            separator = _LVM_SEPARATORS.get(words[1].strip(), "\t")
    for k in range(ends[1]):
        if head.plain(k).startswith("Decimal_Separator"):
            entries["Decimal_Separator"] = [head.plain(k).strip()[-1]]
            continue
        cells = head.cells(k, separator)
        if cells:
            entries[cells[0]] = cells[1:]
    columns = _first(entries, "X_Columns") or "One"
    titles = [cell for cell in head.cells(ends[1] + 1, separator) if cell]
    units = entries.get("Y_Unit_Label", [])
    x_units = ["s" if x == "Time" else "" for x in entries.get("X_Dimension", [])] or ["s"]
    channels = int(_number(head, entries, "Channels", len(titles) - (columns == "One")))
    clocks: dict[int, int] = {}
    if columns == "Multi":
        of_column = [u for k in range(channels) for u in (x_units[k % len(x_units)], _at(units, k))]
        clocks = {2 * k + 1: 2 * k for k in range(channels)}
    elif columns == "No":
        of_column = [_at(units, k) for k in range(channels)]
        titles = titles[1:] if titles[:1] == ["X_Value"] else titles
    else:
        of_column = [x_units[0], *(_at(units, k) for k in range(channels))]
        clocks = dict.fromkeys(range(1, channels + 1), 0)
    first = head.cells(ends[1] + 2, separator) if ends[1] + 2 < len(head.lines) else []
    lead = int(columns == "No" and len(first) > channels and not first[0])  # an empty X_Value
    titles, of_column = [""] * lead + titles, [""] * lead + of_column
    width = max(len(titles), len(of_column))
    of_column += [""] * (width - len(of_column))
    dialect = head.table(separator, titles, of_column, ends[1] + 2, width)
    raster = None
    if columns == "No":
        step = _number(head, entries, "Delta_X", 0.0)
        if not step > 0.0:
            raise FileError(
                f"{head.path} has no X columns, and its Delta_X = {step:g} must be > 0",
                name="Delta_X",
                value=f"{step:g}",
            )
        raster = (_number(head, entries, "X0", 0.0), step)
    mark = _first(entries, "Decimal_Separator")
    named = zip((*titles, *[""] * width), dialect.kinds, strict=False)
    kinds = (TEXT if title == "Comment" else kind for title, kind in named)
    return replace(
        dialect,
        kinds=tuple(kinds),
        clocks=clocks,
        raster=raster,
        is_ragged=True,
        decimal=head.options.decimal or (mark if mark in (".", ",") else dialect.decimal),
    )


def _first(entries: dict[str, list[str]], name: str) -> str:
    return next(iter(entries.get(name, [])), "")


def _at(texts: list[str], k: int) -> str:
    return texts[k] if k < len(texts) else ""


def _number(head: Head, entries: dict[str, list[str]], name: str, default: float) -> float:
    text = _first(entries, name).replace(",", ".")
    try:
        return float(text) if text else default
    except ValueError:
        raise FileError(
            f"{head.path}: {name} = {quoted(text)} in its header is not a number",
            name=name,
            value=quoted(text),
        ) from None


def _vbox(head: Head) -> Dialect:
    sections = dict(_sections(head))
    names = [word for _, line in sections.get("[column names]", []) for word in line.split()]
    begin = next(
        (k for k in range(len(head.lines)) if head.lines[k].strip().casefold() == "[data]"), None
    )
    if begin is None or not names:
        raise FileError(
            f"{head.path} is a VBOX file without column names or [data]", name=str(head.path)
        )
    at = begin + 1
    while at < len(head.lines) and head.is_blank(at):
        at += 1
    described = [line for _, line in sections.get("[header]", [])]
    channels = [line for _, line in sections.get("[channel units]", [])]
    units = [_vbox_unit(name, _at(described, k)) for k, name in enumerate(names)]
    if channels:
        units[-len(channels) :] = channels[: len(units)]
    dialect = head.table(" ", names, units, at, len(names))
    kinds = [
        DIGITS if name.casefold() == "time" else kind
        for name, kind in zip(names, dialect.kinds, strict=True)
    ]
    return replace(dialect, kinds=tuple(kinds), decimal=dialect.decimal or ".")


def _vbox_unit(name: str, description: str) -> str:
    """Return the unit at the end of a description such as ``velocity kmh``, or the usual one."""
    word = description.rpartition(" ")[2] if " " in description else ""
    try:
        unit_of(word)
    except UnitError:
        return _VBOX_UNITS.get(name.casefold(), "")
    return word


def _sections(head: Head) -> Iterator[tuple[str, list[tuple[int, str]]]]:
    """Yield the sections before the data with their lines."""
    title = ""
    lines: list[tuple[int, str]] = []
    for k in range(len(head.lines)):
        text = head.plain(k).strip()
        if text.startswith("[") and text.endswith("]"):
            yield title, lines
            title, lines = text.casefold(), []
            if title == "[data]":
                return
        elif text:
            lines.append((k, text))
    yield title, lines
