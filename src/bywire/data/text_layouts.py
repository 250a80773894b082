"""Text files of programs that put a description before the table: LabVIEW (LVM) and VBOX."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from bywire.core.errors import FileError, UnitError, quoted
from bywire.data.column_units import unit_of
from bywire.data.text_dialect import TEXT, Dialect, Head
from bywire.data.time_stamps import DIGITS

LVM_MARK = "LabVIEW Measurement"
END_OF_HEADER = "***End_of_Header***"
VBOX_MARK = "[column names]"

_LVM_SEPARATORS = {"Tab": "\t", "Comma": ",", "Semicolon": ";", "Space": " "}
_VBOX_UNITS = {
    "sats": "1", "satellites": "1", "lat": "arcmin", "latitude": "arcmin", "long": "arcmin",
    "longitude": "arcmin", "velocity": "km/h", "heading": "deg", "height": "m",
}  # fmt: skip
"""units of the columns that every VBOX writes, by the manufacturer's description of its files"""


def layout_of(head: Head) -> Dialect | None:
    """Return the dialect of a file of LabVIEW or of a VBOX; None of other files.

    Raises
    ------
    FileError
        When its description does not fit together.
    """
    if head.lines and head.lines[0].startswith(LVM_MARK):
        return _lvm(head)
    if any(line.strip().casefold() == VBOX_MARK for line in head.lines):
        return _vbox(head)
    return None


def _lvm(head: Head) -> Dialect:
    separator, entries = "\t", {}
    ends = [k for k in range(len(head.lines)) if head.lines[k].startswith(END_OF_HEADER)]
    if len(ends) < 2:
        raise FileError(
            f"{head.path}: it is a file of LabVIEW without a table: its header has no second "
            f"line {END_OF_HEADER!r}"
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
            raise FileError(f"{head.path}: it has no X columns, and its Delta_X is {step:g}")
        raster = (_number(head, entries, "X0", 0.0), step)
    mark = _first(entries, "Decimal_Separator")
    named = zip((*titles, *[""] * width), dialect.kinds, strict=False)
    kinds = (TEXT if title == "Comment" else kind for title, kind in named)
    return replace(
        dialect, kinds=tuple(kinds), clocks=clocks, raster=raster, is_ragged=True,
        decimal=head.options.decimal or (mark if mark in (".", ",") else dialect.decimal),
    )  # fmt: skip


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
            f"{head.path}: {name} = {quoted(text)} in its header is not a number"
        ) from None


def _vbox(head: Head) -> Dialect:
    sections = dict(_sections(head))
    names = [word for _, line in sections.get("[column names]", []) for word in line.split()]
    begin = next((k for k in range(len(head.lines))
                  if head.lines[k].strip().casefold() == "[data]"), None)  # fmt: skip
    if begin is None or not names:
        raise FileError(f"{head.path}: it is a file of a VBOX without column names or [data]")
    at = begin + 1
    while at < len(head.lines) and head.is_blank(at):
        at += 1
    described = [line for _, line in sections.get("[header]", [])]
    channels = [line for _, line in sections.get("[channel units]", [])]
    units = [_vbox_unit(name, _at(described, k)) for k, name in enumerate(names)]
    if channels:
        units[-len(channels) :] = channels[: len(units)]
    dialect = head.table(" ", names, units, at, len(names))
    kinds = [DIGITS if name.casefold() == "time" else kind
             for name, kind in zip(names, dialect.kinds, strict=True)]  # fmt: skip
    return replace(dialect, kinds=tuple(kinds), decimal=dialect.decimal or ".")


def _vbox_unit(name: str, description: str) -> str:
    """Return the unit behind a description such as ``velocity kmh``, or the usual one."""
    word = description.rpartition(" ")[2] if " " in description else ""
    try:
        unit_of(word)
    except UnitError:
        return _VBOX_UNITS.get(name.casefold(), "")
    return word


def _sections(head: Head) -> Iterator[tuple[str, list[tuple[int, str]]]]:
    """Yield the sections before the data with their lines."""
    title, lines = "", []
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
