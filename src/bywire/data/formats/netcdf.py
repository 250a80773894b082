"""NetCDF: signals with units on named dimensions, as recordings of bywire are stored."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bywire.core.errors import FileError
from bywire.data.declared_size import require_possible
from bywire.data.file_format import Column, FileFormat, Progress, ReadOptions
from bywire.data.netcdf3_header import require_sound_header

if TYPE_CHECKING:
    import xarray as xr

_VALUES = 1 << 22  # that are read at a time
_MAGICS = (b"CDF\x01", b"CDF\x02", b"CDF\x05", b"\x89HDF\r\n\x1a\n")


class NetcdfSource:
    """An open NetCDF file; variables of one dimension count, groups and tables do not."""

    def __init__(self, path: Path, file: Any) -> None:
        self._path = path
        self._file = file
        self.columns = _columns(file)

    def read(self, names: Sequence[str], progress: Progress) -> dict[str, NDArray[np.float64]]:
        """Return the numbers of some variables; what was never written becomes NaN."""
        stored = self._path.stat().st_size
        found = {}
        for k, name in enumerate(names):
            variable = self._file.variables[name]
            (size,) = variable.shape
            require_possible(self._path, repr(name), size * variable.dtype.itemsize, stored)
            numbers = np.empty(size)
            for begin in range(0, size, _VALUES):
                part = slice(begin, min(begin + _VALUES, size))
                numbers[part] = np.ma.filled(variable[part].astype(np.float64), np.nan)
                progress(f"reading {self._path.name}", (k + part.stop / size) / len(names))
            found[name] = numbers
        return found

    def place(self, name: str, row: int) -> str:
        """Return the index of a value."""
        return f"index {row}"


def _columns(file: Any) -> Mapping[str, Column]:
    found = {}
    for name, variable in file.variables.items():
        if len(variable.shape) != 1 or not np.issubdtype(variable.dtype, np.number):
            continue
        (dim,) = variable.dimensions
        clock = dim if dim in file.variables and dim != name else None
        unit = str(getattr(variable, "units", "")).partition(" since ")[0]
        label = str(getattr(variable, "long_name", ""))
        meanings = str(getattr(variable, "flag_meanings", ""))
        found[name] = Column(name, unit, variable.shape[0], clock, label, meanings)
    return {n: c for n, c in found.items() if c.clock is None or c.clock in found}


@contextmanager
def _open(path: Path, options: ReadOptions) -> Iterator[NetcdfSource]:
    import netCDF4

    require_sound_header(path)
    try:
        with netCDF4.Dataset(path, "r") as file:
            yield NetcdfSource(path, file)
    except (RuntimeError, ValueError, OSError, OverflowError, UnicodeError, IndexError) as error:
        reason = getattr(error, "strerror", None) or " ".join(str(error).split())[:200]
        raise FileError(
            f"{path} is a damaged NetCDF file ({reason}): copy or export it again"
        ) from None


def _write(dataset: xr.Dataset, path: Path, progress: Progress) -> None:
    names = [*dataset.data_vars, *dataset.coords]
    packed = {"zlib": True, "complevel": 1, "_FillValue": None}
    progress(f"writing {path.name}", 0.0)
    dataset.to_netcdf(path, engine="netcdf4", encoding={str(name): packed for name in names})
    progress(f"writing {path.name}", 1.0)


FORMAT = FileFormat(
    "netcdf", "a NetCDF file", (".nc", ".nc4", ".cdf"),
    lambda head: head.startswith(_MAGICS), _open, _write, has_many_axes=True,
)  # fmt: skip
