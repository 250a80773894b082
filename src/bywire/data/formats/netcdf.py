"""NetCDF: signals with units on named dimensions, the format of bywire's recordings."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bywire.core.errors import FileError
from bywire.core.interrupts import interrupts_deferred
from bywire.core.typing import Progress
from bywire.data.file_format import Column, FileFormat, ReadOptions

if TYPE_CHECKING:
    import xarray as xr

_VALUES = 1 << 22  # numbers per piece
_CLASSIC = ("NETCDF3_CLASSIC", "NETCDF3_64BIT_OFFSET", "NETCDF3_64BIT")
_MAGICS = (b"CDF\x01", b"CDF\x02", b"CDF\x05", b"\x89HDF\r\n\x1a\n")


class NetcdfSource:
    """An open NetCDF file, of which bywire reads one-dimensional variables, but no groups."""

    def __init__(self, path: Path, file: Any) -> None:
        self._path = path
        self._file = file
        self.columns = _columns(file)

    def pieces(self, names: Sequence[str]) -> Iterator[tuple[str, int, NDArray[Any]]]:
        """Yield the numbers of some variables; unwritten numbers become NaN."""
        for name in names:
            variable = self._file.variables[name]
            for begin in range(0, variable.shape[0], _VALUES):
                values = variable[begin : begin + _VALUES]
                yield name, begin, np.ma.filled(values.astype(np.float64), np.nan)


def _columns(file: Any) -> Mapping[str, Column]:
    columns = {}
    for name, variable in file.variables.items():
        if len(variable.shape) != 1 or not np.issubdtype(variable.dtype, np.number):
            continue
        (dim,) = variable.dimensions
        clock = dim if dim in file.variables and dim != name else None
        unit = str(getattr(variable, "units", "")).partition(" since ")[0]
        label = str(getattr(variable, "long_name", ""))
        meanings = str(getattr(variable, "flag_meanings", ""))
        columns[name] = Column(name, unit, variable.shape[0], clock, label, meanings)
    return {n: c for n, c in columns.items() if c.clock is None or c.clock in columns}


@contextmanager
def _open(path: Path, options: ReadOptions) -> Iterator[NetcdfSource]:
    import netCDF4

    with netCDF4.Dataset(path, "r") as file:
        _require_whole(path, file)
        yield NetcdfSource(path, file)


def _require_whole(path: Path, file: Any) -> None:
    """Reject a truncated classic file, since the library reads zeros beyond its end."""
    if file.data_model in _CLASSIC:
        from scipy.io import netcdf_file

        netcdf_file(path, mmap=True).close()  # maps every variable, so each must be complete
    elif file.data_model.startswith("NETCDF3"):  # 64-bit sizes, which SciPy does not support
        size = sum(math.prod(v.shape) * v.dtype.itemsize for v in file.variables.values())
        if size > path.stat().st_size:
            raise FileError(
                f"{path} is damaged: it declares {size} bytes of numbers, but the file has only "
                f"{path.stat().st_size} bytes. Copy or export it again",
                name=str(path),
            )


def _write(dataset: xr.Dataset, path: Path, progress: Progress) -> None:
    names = [*dataset.data_vars, *dataset.coords]
    packed = {"zlib": True, "complevel": 1, "_FillValue": None}
    progress(f"writing {path.name}", 0.0)
    with interrupts_deferred():  # Ctrl-C could otherwise leave one of xarray's locks locked
        dataset.to_netcdf(path, engine="netcdf4", encoding={str(name): packed for name in names})
    progress(f"writing {path.name}", 1.0)


FORMAT = FileFormat(
    "netcdf",
    "a NetCDF file",
    (".nc", ".nc4", ".cdf"),
    lambda head: head.startswith(_MAGICS),
    _open,
    _write,
    has_many_axes=True,
    libraries=("netCDF4",),
    counts=("index", 0),
)
