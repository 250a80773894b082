"""How signals lie in MAT files of both kinds: columns of arrays, and structs that describe them.

Beside the arrays, ``units`` holds the unit of each, ``clocks`` the name of its instants, and
``labels`` a description. In files of others these structs may be absent: a mapping then says it.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from bywire.core.errors import FileError, quoted
from bywire.data.file_format import Column

if TYPE_CHECKING:
    import xarray as xr

NOTES = {"units": "units", "labels": "long_name"}
"""structs of texts, and the attributes of a signal that they hold"""

CLOCKS = "clocks"
"""struct with the name of the instants of each signal"""

_MOST_COLUMNS = 64  # of a table: a wider one is no table of signals
_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,62}")


@dataclass(frozen=True)
class Part:
    """A column of an array in a file.

    Parameters
    ----------
    array
        Name of the array, with those of the structs around it.
    index
        Which column of a table, from 0; None for a vector.
    length
        How many numbers it has.
    """

    array: str
    index: int | None
    length: int


def parts_of(name: str, shape: Sequence[int]) -> dict[str, Part]:
    """Return the columns of an array of MATLAB's shape: a vector, or a table ``name(:,k)``."""
    if len(shape) > 2 or not all(shape):
        return {}
    rows, columns = (*shape, 1, 1)[:2]
    if 1 in (rows, columns):
        size = rows * columns
        return {name: Part(name, None, size)} if size > 1 else {}
    if columns > _MOST_COLUMNS:
        return {}
    return {f"{name}(:,{k + 1})": Part(name, k, rows) for k in range(columns)}


def columns_of(parts: Mapping[str, Part], texts: Mapping[str, str]) -> dict[str, Column]:
    """Return the columns with what the structs say of them.

    Parameters
    ----------
    parts
        Columns by name.
    texts
        Texts in structs by dotted name, for instance ``units.p_mc``.
    """
    columns = {}
    for name, part in parts.items():
        unit, label = (texts.get(f"{struct}.{name}", "") for struct in NOTES)
        clock = texts.get(f"{CLOCKS}.{name}", "")
        columns[name] = Column(name, unit, part.length, clock if clock in parts else None, label)
    return columns


def described(dataset: xr.Dataset, path: Path) -> dict[str, dict[str, str]]:
    """Return the structs of texts that describe the signals of a dataset.

    Raises
    ------
    FileError
        When a name is none in MATLAB.
    """
    axes = list(dict.fromkeys(str(signal.dims[0]) for signal in dataset.data_vars.values()))
    signals = [str(name) for name in dataset.data_vars]
    for name in (*signals, *axes):
        if not _NAME.fullmatch(name) or name in (*NOTES, CLOCKS):
            raise FileError(
                f"cannot write {path}: {quoted(name)} is no name of a variable in MATLAB: letters, "
                "digits and _ after a letter; choose another name in a mapping"
            )
    structs = {
        struct: {n: str(dataset[n].attrs.get(key, "")) for n in (*signals, *axes)}
        for struct, key in NOTES.items()
    }
    structs[CLOCKS] = {name: str(dataset[name].dims[0]) for name in signals}
    return structs
