"""Layout of signals in MAT files of both kinds: columns of arrays, and structs with their meaning.

In addition to the arrays, ``units`` contains the unit of each signal, ``clocks`` the name of its
time array, and ``labels`` a description. Files without these structs need a mapping.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

from bywire.core.errors import FileError, quoted
from bywire.data.column_units import split_title
from bywire.data.file_format import Column

if TYPE_CHECKING:
    import xarray as xr

NOTES = {"units": "units", "labels": "long_name"}
"""structs of texts, and the attributes of a signal in them"""

CLOCKS = "clocks"
"""struct with the name of each signal's time array"""

_SIGNAL = r"(?P<signal>(?P<scope>.+)\.{}(?:\([0-9]+\))?)\.{}(?P<column>\(:,[0-9]+\)|\([0-9]+,:\))?"
_SIMULINK = re.compile(_SIGNAL.format("signals", "values"))
_DSPACE = re.compile(_SIGNAL.format("Y", "Data"))
_SERIES = re.compile(r"(?P<scope>.+)\.(?:Data|data)(?P<column>\(:,[0-9]+\)|\([0-9]+,:\))?")
OBJECT = (
    "it is a MATLAB object, such as a timeseries or a Dataset, which only MATLAB can read. Save "
    "its times and values as arrays, for example t = ts.Time and y = ts.Data"
)
"""reason to skip an object"""

_MOST_COLUMNS = 64  # maximum width of a table of signals
_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,62}")


@dataclass(frozen=True)
class Part:
    """A column of an array in a file.

    Parameters
    ----------
    array
        Name of the array, with the names of its structs.
    index
        Index of the column, or row, in a table; None for a vector.
    length
        Number of its values.
    is_row
        Whether it is a row of a wide table, as Simulink's To File writes its signals.
    """

    array: str
    index: int | None
    length: int
    is_row: bool = False


@dataclass
class Found:
    """Content of a MAT file.

    Parameters
    ----------
    parts
        Columns of its arrays by name.
    texts, scalars
        Texts and single numbers in structs by dotted name, for example ``units.p_mc``.
    left_out
        Skipped content with the reason.
    """

    parts: dict[str, Part] = field(default_factory=dict)
    texts: dict[str, str] = field(default_factory=dict)
    scalars: dict[str, float] = field(default_factory=dict)
    left_out: dict[str, str] = field(default_factory=dict)

    def add(self, name: str, shape: Sequence[int]) -> None:
        """Add the columns of an array of MATLAB's shape: a vector, ``a(:,k)`` or ``a(k,:)``."""
        long = [size for size in shape if size > 1]
        if not all(shape) or not long:
            return  # empty, or a single number
        if len(long) == 1:
            self.parts[name] = Part(name, None, long[0])
        elif len(shape) > 2:
            self.left_out[name] = f"it has {len(shape)} dimensions"
        elif shape[1] <= _MOST_COLUMNS:
            for k in range(shape[1]):
                self.parts[f"{name}(:,{k + 1})"] = Part(name, k, shape[0])
        elif shape[0] <= _MOST_COLUMNS:
            for k in range(shape[0]):
                self.parts[f"{name}({k + 1},:)"] = Part(name, k, shape[1], is_row=True)
        else:
            self.left_out[name] = f"it is a table of {shape[0]} x {shape[1]} numbers"


def columns_of(
    found: Found, is_increasing: Callable[[Part], bool], remarks: list[str]
) -> tuple[dict[str, Column], dict[str, Part]]:
    """Return the columns with their descriptions from structs, and their places.

    Signals from Simulink and dSPACE keep their names.

    Parameters
    ----------
    found
        Content of the file.
    is_increasing
        Returns whether the numbers of a part increase, like times.
    remarks
        List that receives notes.
    """
    columns, parts = {}, {}
    recorded = dict(_recorded(found))
    short = Counter(_short(each) for each in recorded.values())
    for name, part in found.parts.items():
        unit, label = (found.texts.get(f"{struct}.{name}", "") for struct in NOTES)
        clock = found.texts.get(f"{CLOCKS}.{name}", "")
        shown = name
        if name in recorded:
            given, clock = recorded[name].name, recorded[name].clock
            unit, label = recorded[name].unit, given or label
            brief = _short(recorded[name])
            shown = brief if brief and short[brief] == 1 and brief not in found.parts else name
        elif name in {each.clock for each in recorded.values()} or name == "tout":
            unit = unit or found.texts.get(f"{name.removesuffix('.Data')}.Unit", "").strip() or "s"
        elif part.is_row and not unit:
            clock, unit = _of_row(found, name, part, is_increasing, remarks)
        columns[shown] = Column(shown, unit, part.length, clock, label, path=name)
        parts[shown] = part
    names = {id(part): shown for shown, part in parts.items()}
    for shown, column in columns.items():
        there = found.parts.get(column.clock or "")
        columns[shown] = replace(column, clock=names[id(there)] if there is not None else None)
    return columns, parts


@dataclass(frozen=True)
class _Recorded:
    name: str
    unit: str
    clock: str
    suffix: str = ""


def _recorded(found: Found) -> Iterator[tuple[str, _Recorded]]:
    """Yield the signals that Simulink and dSPACE describe in structs."""
    for name in found.parts:
        if match := _SIMULINK.fullmatch(name):
            clock, text = f"{match['scope']}.time", found.texts.get(f"{match['signal']}.label", "")
            title, unit = split_title(text.strip())
        elif match := _DSPACE.fullmatch(name):
            which = int(found.scalars.get(f"{match['signal']}.XIndex", 1))
            clock = f"{match['scope']}.X({which}).Data"
            clock = clock if clock in found.parts else f"{match['scope']}.X.Data"
            title = found.texts.get(f"{match['signal']}.Name", "").strip()
            unit = found.texts.get(f"{match['signal']}.Unit", "").strip()
        elif match := _SERIES.fullmatch(name):
            title, unit = match["scope"], ""
            clock = next(
                (
                    f"{match['scope']}.{t}"
                    for t in ("Time", "time")
                    if f"{match['scope']}.{t}" in found.parts
                ),
                "",
            )
        else:
            continue
        if clock in found.parts:
            yield name, _Recorded(title, unit, clock, match["column"] or "")


def _short(recorded: _Recorded) -> str:
    """Return the last part of a signal's name, without its blocks."""
    brief = recorded.name.rpartition("/")[2].strip().strip('"')
    return brief + recorded.suffix if brief else ""


def _of_row(
    found: Found, name: str, part: Part, is_increasing: Callable[[Part], bool], remarks: list[str]
) -> tuple[str, str]:
    """Return clock and unit of a row of a wide table whose first row contains the times."""
    first = f"{part.array}(1,:)"
    if first not in found.parts or not is_increasing(found.parts[first]):
        return "", ""
    if name == first:
        remarks.append(
            f"{part.array} has a signal in each row. The first row increases, so bywire reads it "
            "as time in s, as written by Simulink's To File block"
        )
    return ("", "s") if name == first else (first, "")


def described(dataset: xr.Dataset, path: Path) -> dict[str, dict[str, str]]:
    """Return the structs of texts that describe the signals of a dataset.

    Raises
    ------
    FileError
        When a name is not valid in MATLAB.
    """
    axes = list(dict.fromkeys(str(signal.dims[0]) for signal in dataset.data_vars.values()))
    signals = [str(name) for name in dataset.data_vars]
    for name in (*signals, *axes):
        if not _NAME.fullmatch(name) or name in (*NOTES, CLOCKS):
            raise FileError(
                f"cannot write {path}: {quoted(name)} is not a valid variable name in MATLAB "
                "(letters, digits and _ after a letter). Choose another name in a mapping",
                name=name,
            )
    structs = {
        struct: {n: str(dataset[n].attrs.get(key, "")) for n in (*signals, *axes)}
        for struct, key in NOTES.items()
    }
    structs[CLOCKS] = {name: str(dataset[name].dims[0]) for name in signals}
    return structs
