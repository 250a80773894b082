"""Recordings as NetCDF files, written completely or not at all, and read in a child process.

The library trusts a file's own declarations: a damaged file may crash it, or make it run forever
without reacting to Ctrl-C.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bywire.core.arguments import checked
from bywire.core.errors import FileError
from bywire.core.interrupts import interrupts_deferred
from bywire.core.scratch import replacing
from bywire.core.typing import silent
from bywire.data.file_format import Column, FileFormat, ReadOptions, require_room
from bywire.data.format_registry import head_of
from bywire.data.formats.netcdf import FORMAT as NETCDF
from bywire.data.limited_source import limited

if TYPE_CHECKING:
    import xarray as xr

    from bywire.data.limited_source import LimitedSource

_VALUES = 1 << 22  # numbers per message


@checked
def write_recording(recording: xr.Dataset, path: str | Path) -> Path:
    """Write a recording.

    Parameters
    ----------
    recording
        Signals with ``units`` among their attributes.
    path
        NetCDF file; bywire replaces an existing one.

    Returns
    -------
    pathlib.Path
        The file.

    Raises
    ------
    FileError
        When the file cannot be written, for example because the disk is full.
    """
    path = Path(path)
    write = _write_rows if _are_plain_rows(recording) else _write_dataset
    try:
        # Ctrl-C could leave one of xarray's locks locked, so closing would wait forever.
        with replacing(path) as fresh, interrupts_deferred():
            write(recording, fresh)
    except (OSError, RuntimeError, ValueError) as error:  # RuntimeError: from the HDF library
        reason = getattr(error, "strerror", None) or str(error)
        raise FileError(
            f"cannot write {path}: {reason}. Free some space there, or choose a writable folder",
            name=str(path),
        ) from None
    return path


_PACKED = {"zlib": True, "complevel": 1}


def _write_dataset(recording: xr.Dataset, path: Path) -> None:
    encoding = dict.fromkeys(map(str, recording.data_vars), _PACKED)
    recording.to_netcdf(path, engine="netcdf4", encoding=encoding)


def _are_plain_rows(recording: xr.Dataset) -> bool:
    """Return whether a recording is not a dataset but plain rows of numbers over time."""
    if not hasattr(recording, "stands_for"):
        return False
    return all(row.values.dtype == np.float64 for row in recording.variables.values())


def _write_rows(recording: xr.Dataset, path: Path) -> None:
    """Write the file that xarray would write; loading xarray takes as long as half of a run."""
    import netCDF4

    with netCDF4.Dataset(path, "w", format="NETCDF4") as file:
        for name, value in recording.attrs.items():
            texts = np.asarray(value)
            is_list = texts.dtype.kind == "U" and texts.size > 1
            (file.setncattr_string if is_list else file.setncattr)(name, value)
        file.createDimension("time", recording.sizes["time"])
        for name, row in recording.variables.items():
            packed: dict[str, Any] = _PACKED if name in recording.data_vars else {}
            variable = file.createVariable(str(name), "f8", ("time",), fill_value=np.nan, **packed)
            variable.setncatts(row.attrs)
            variable[...] = row.values


@checked
def read_recording(path: str | Path) -> xr.Dataset:
    """Read a recording into memory.

    Parameters
    ----------
    path
        NetCDF file.

    Returns
    -------
    xarray.Dataset
        Signals with ``units`` among their attributes, over ``time`` [s].

    Raises
    ------
    FileError
        When the file cannot be read, is damaged, or is not a NetCDF file.
    """
    file = Path(path)
    if not NETCDF.recognizes(head_of(file)):
        raise FileError(
            f"cannot read recording {file}: it is not a NetCDF file. Use bywire convert or "
            "read_measurement for other formats",
            name=str(file),
        )
    with limited(file, FORMAT) as source:
        require_room(file, source)
        return _dataset(source)


class RecordingSource:
    """An open recording: numbers of any shape as columns, other content as notes.

    Parameters
    ----------
    variables
        Decoded content of the file.
    attributes
        Attributes of the file.
    coords
        Names of coordinates that are not dimensions.
    """

    def __init__(
        self,
        variables: Mapping[str, xr.Variable],
        attributes: Mapping[Any, Any],
        coords: Sequence[str],
    ) -> None:
        self._variables = variables
        numbers = {name: v for name, v in variables.items() if v.dtype.kind in "iufbmM"}
        self.columns: Mapping[str, Column] = {
            name: Column(name, length=variable.size) for name, variable in numbers.items()
        }
        self.notes = {
            "attrs": _plain(attributes),
            "coords": list(coords),
            "variables": {
                name: {
                    "dims": list(variable.dims),
                    "shape": list(variable.shape),
                    "kind": variable.dtype.str,
                    "attrs": _plain(variable.attrs),
                    "texts": None if name in numbers else variable.values.astype(str).tolist(),
                }
                for name, variable in variables.items()
            },
        }

    def pieces(self, names: Sequence[str]) -> Iterator[tuple[str, int, NDArray[Any]]]:
        """Yield numbers row by row, without conversion if they have eight bytes."""
        for name in names:
            flat = np.ascontiguousarray(self._variables[name].values).reshape(-1)
            plain = flat.view(np.float64) if flat.itemsize == 8 else flat
            for begin in range(0, flat.size, _VALUES):
                yield name, begin, plain[begin : begin + _VALUES]


def _plain(attributes: Mapping[Any, Any]) -> dict[str, Any]:
    """Return attributes as JSON data: texts, and numbers with their type."""
    return {
        str(name): value
        if isinstance(value, str)
        else {"kind": np.asarray(value).dtype.str, "values": np.asarray(value).tolist()}
        for name, value in attributes.items()
    }


def _attributes(plain: Mapping[str, Any]) -> dict[str, Any]:
    """Return attributes in xarray's types."""
    return {
        name: value if isinstance(value, str) else np.array(value["values"], value["kind"])[()]
        for name, value in plain.items()
    }


def _dataset(source: LimitedSource) -> xr.Dataset:
    import xarray as xr  # slow to load

    columns = source.read(list(source.columns), silent)
    variables = {}
    for name, described in source.notes["variables"].items():
        kind = np.dtype(described["kind"])
        if name not in columns:
            values = np.array(described["texts"], dtype=object if kind.kind == "O" else kind)
        elif kind.itemsize == 8:
            values = columns.pop(name).view(kind)
        else:
            values = columns.pop(name).astype(kind)
        shaped = values.reshape(described["shape"])
        variables[name] = (described["dims"], shaped, _attributes(described["attrs"]))
    coords = {name: variables.pop(name) for name in source.notes["coords"]}
    attributes = _attributes(source.notes["attrs"])
    if "warnings" in attributes:  # NetCDF stores a list of one text as a text
        texts = np.atleast_1d(attributes["warnings"]).tolist()
        attributes["warnings"] = [text for text in texts if text]
    return xr.Dataset(variables, coords, attributes)


@contextmanager
def _open(path: Path, options: ReadOptions) -> Iterator[RecordingSource]:
    import xarray as xr  # slow to load

    # Not open_dataset: its indexes, not needed here, load libraries for other array types. This
    # would happen after each fork, for every file, and take half a second.
    store = xr.backends.NetCDF4DataStore.open(path)  # type: ignore[no-untyped-call]
    try:
        stored, attributes = store.load()
        variables, attributes, named = xr.conventions.decode_cf_variables(stored, attributes)
        recorded = {str(name): variable for name, variable in variables.items()}
        yield RecordingSource(recorded, attributes, [name for name in recorded if name in named])
    finally:
        store.close()


FORMAT = FileFormat(
    "recording",
    "a recording",
    NETCDF.endings,
    NETCDF.recognizes,
    _open,
    NETCDF.write,
    has_many_axes=True,
    libraries=("netCDF4", "xarray"),
    counts=("index", 0),
)
"""format for recordings in the child process; measurement files have the format ``netcdf``"""
