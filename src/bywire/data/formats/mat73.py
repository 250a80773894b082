"""MAT files of version 7.3, and other HDF5 files, read and written by h5py."""

from __future__ import annotations

import io
import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from io import FileIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bywire.core.errors import FileError
from bywire.core.typing import Progress
from bywire.data.file_format import Column, FileFormat, ReadOptions, library
from bywire.data.matlab_layout import OBJECT, Found, Part, columns_of, described

if TYPE_CHECKING:
    import xarray as xr
    from _typeshed import ReadableBuffer as Buffer
    from _typeshed import WriteableBuffer


_VALUES = 1 << 22  # numbers per piece
_DEEPEST, _MOST = 8, 10_000  # maximum depth of nested groups; maximum objects in a file
_MOST_STRUCTS = 1000  # maximum size of an array of structs
_MOST_ROWS = 64
_LONGEST = 1000  # characters of a text
_USER_BLOCK = 512
_HEADER = b"MATLAB 7.3 MAT-file, written by bywire".ljust(116) + bytes(8) + b"\x00\x02IM"
_NETCDF = "_NCProperties"  # attribute of NetCDF files, which may contain packed numbers
_HDF5 = b"\x89HDF\r\n\x1a\n"
_WHAT = "MAT files of version 7.3"


class Mat73Source:
    """An open HDF5 file; its groups are structs."""

    def __init__(self, path: Path, file: Any) -> None:
        self._path, self._file = path, file
        self._is_matlab = file.userblock_size >= _USER_BLOCK
        self._arrays: dict[str, Any] = {}
        found = Found()
        self._walk(file, "", 0, found)
        for name, array in self._arrays.items():
            found.add(name, self._shape(array))
        self.remarks: list[str] = []
        self.left_out: Mapping[str, str] = found.left_out
        columns, self._parts = columns_of(found, self._is_increasing, self.remarks)
        self.columns: Mapping[str, Column] = {n: self._with_unit(c) for n, c in columns.items()}

    def pieces(self, names: Sequence[str]) -> Iterator[tuple[str, int, NDArray[Any]]]:
        """Yield the numbers of some columns."""
        for name in names:
            part = self._parts[name]
            array = self._arrays[part.array]
            self._require_whole(part.array, array)
            for begin in range(0, part.length, _VALUES):
                piece = slice(begin, min(begin + _VALUES, part.length))
                yield name, begin, array[self._index(array, part, piece)]

    def _walk(self, group: Any, prefix: str, depth: int, found: Found) -> None:
        """Collect arrays and texts, without following links."""
        import h5py

        for name in group:
            if name.startswith("#"):
                continue
            if not isinstance(group.get(name, getlink=True), h5py.HardLink):
                found.left_out[f"{prefix}{name}"] = "it is a link, and bywire does not follow links"
                continue
            self._take(group[name], f"{prefix}{name}", depth, found)

    def _take(self, item: Any, name: str, depth: int, found: Found) -> None:
        """Collect an array, a text, or the arrays of a group or of an array of structs."""
        import h5py

        if len(self._arrays) + len(found.texts) + len(found.scalars) > _MOST:
            raise FileError(
                f"{self._path} contains more than {_MOST} arrays. Use another file",
                name=str(self._path),
            )
        if isinstance(item, h5py.Group):
            if depth < _DEEPEST:
                self._walk(item, f"{name}.", depth + 1, found)
            return
        if not isinstance(item, h5py.Dataset) or not item.shape:
            return
        kind = _attribute(item, "MATLAB_class")
        if "MATLAB_object_decode" in item.attrs:
            found.left_out[name] = OBJECT
        elif kind == "char":
            found.texts[name] = self._text(item)
        elif item.dtype.kind in "iufb" and item.size == 1 and self._is_matlab:
            found.scalars[name] = float(item[()].reshape(-1)[0])
        elif item.dtype.kind in "iufb":
            self._arrays[name] = item
        elif h5py.check_ref_dtype(item.dtype) is h5py.Reference and not kind:
            self._take_structs(item, name, depth, found)
        else:
            found.left_out[name] = (
                "it is an array of cells" if kind == "cell" else "it does not contain real numbers"
            )

    def _take_structs(self, item: Any, name: str, depth: int, found: Found) -> None:
        """Collect a field of an array of structs, which refers to an array for each struct."""
        if item.size > _MOST_STRUCTS or depth >= _DEEPEST:
            found.left_out[name] = f"it is an array of {item.size} structs"
            return
        outer, _, field = name.rpartition(".")
        for k, reference in enumerate(item[()].reshape(-1), 1):
            if reference:
                self._take(self._file[reference], f"{outer}({k}).{field}", depth + 1, found)

    def _is_increasing(self, part: Part) -> bool:
        array = self._arrays[part.array]
        if array.is_virtual or array.external or array.size > _VALUES * _MOST_ROWS:
            return False
        return bool(np.all(np.diff(array[self._index(array, part, slice(0, part.length))]) > 0))

    def _text(self, array: Any) -> str:
        if array.size > _LONGEST or array.dtype != np.uint16:
            return ""
        codes = np.asarray(array[()]).astype("<u2").reshape(-1)
        return codes.tobytes().decode("utf-16-le", "replace")

    def _with_unit(self, column: Column) -> Column:
        """Return a column with the unit from its array's attribute, if no struct has one."""
        array = self._arrays[self._parts[column.name].array]
        unit = column.unit or _attribute(array, "units") or _attribute(array, "unit")
        label = column.label or _attribute(array, "long_name")
        return replace(column, unit=unit, label=label)

    def _shape(self, array: Any) -> tuple[int, ...]:
        """Return the shape in MATLAB, which has the opposite order."""
        return tuple(array.shape[::-1]) if self._is_matlab else tuple(array.shape)

    def _index(self, array: Any, part: Part, piece: slice) -> tuple[Any, ...]:
        if part.index is not None:
            is_first = self._is_matlab != part.is_row
            return (part.index, piece) if is_first else (piece, part.index)
        long = max(range(array.ndim), key=lambda axis: array.shape[axis])
        return tuple(piece if axis == long else 0 for axis in range(array.ndim))

    def _require_whole(self, name: str, array: Any) -> None:
        """Reject numbers that are not in the file, since the library would read them as zeros."""
        if array.is_virtual or array.external:
            raise FileError(
                f"{self._path}: {name!r} is stored in other files, which bywire does not open. "
                "Save it in one file",
                name=name,
            )
        if array.chunks is None:
            is_whole = array.id.get_storage_size() >= array.nbytes
        else:
            wanted = (-(-n // m) for n, m in zip(array.shape, array.chunks, strict=True))
            is_whole = array.id.get_num_chunks() >= math.prod(wanted)
        if not is_whole and not np.isnan(float(array.fillvalue)):
            raise FileError(
                f"{self._path}: some of the {array.size} numbers of {name!r} were never written. "
                "The recording may have been interrupted. Save only the written numbers",
                name=name,
            )


def _attribute(item: Any, name: str) -> str:
    """Return a short text attribute; empty for anything else."""
    if name not in item.attrs or math.prod(item.attrs.get_id(name).shape or ()) > 1:
        return ""
    value = item.attrs[name]
    text = value.decode("utf-8", "replace") if isinstance(value, bytes) else value
    return str(text)[:_LONGEST] if isinstance(text, str) else ""


@contextmanager
def _open(path: Path, options: ReadOptions) -> Iterator[Mat73Source]:
    import h5py

    with h5py.File(path, "r") as file:
        if _NETCDF in file.attrs:
            raise FileError(
                f"{path} is a NetCDF file. Rename it with the extension .nc, or specify "
                "format = 'netcdf'",
                name=str(path),
                valid="'netcdf'",
            )
        yield Mat73Source(path, file)


def _write(dataset: xr.Dataset, path: Path, progress: Progress) -> None:
    h5py = library("h5py", _WHAT)
    texts = described(dataset, path)
    with kept(path) as whole, h5py.File(whole, "w", userblock_size=_USER_BLOCK) as file:
        for k, (name, variable) in enumerate(dataset.variables.items()):
            numbers = np.asarray(variable.values, dtype=np.float64).reshape(1, -1)
            written = file.create_dataset(
                str(name), data=numbers, compression="gzip", shuffle=True, compression_opts=1
            )
            written.attrs["MATLAB_class"] = np.bytes_("double")
            progress(f"writing {path.name}", (k + 1) / len(dataset.variables))
        for struct, fields in texts.items():
            group = file.create_group(struct)
            group.attrs["MATLAB_class"] = np.bytes_("struct")
            for name, text in fields.items():
                codes = np.frombuffer(text.encode("utf-16-le"), dtype="<u2").reshape(-1, 1)
                _write_text(group, name, text, codes)
    with path.open("r+b") as stream:
        stream.write(_HEADER)


def _write_text(group: Any, name: str, text: str, codes: NDArray[np.uint16]) -> None:
    """Write a text as MATLAB does: a column with one number for each character."""
    if not text:
        written = group.create_dataset(name, data=np.array([0, 0], dtype=np.uint64))
        written.attrs["MATLAB_empty"] = np.uint8(1)
    else:
        written = group.create_dataset(name, data=codes)
        written.attrs["MATLAB_int_decode"] = np.int32(2)
    written.attrs["MATLAB_class"] = np.bytes_("char")


FORMAT = FileFormat(
    "mat73",
    "an HDF5 file",
    (".mat", ".h5", ".hdf5"),
    lambda head: head[:8] == _HDF5 or head[512:520] == _HDF5,
    _open,
    _write,
    has_many_axes=True,
    libraries=("h5py",),
    counts=("index", 1),
)


class FailingStream(io.RawIOBase):
    """A file that stores its first error and then stops writing.

    The HDF library does not survive a failed write: it writes its buffers again when the process
    ends, which crashes the process.

    Parameters
    ----------
    stream
        The file, unbuffered.
    """

    def __init__(self, stream: FileIO) -> None:
        super().__init__()
        self._stream = stream
        self.error: OSError | None = None

    def write(self, data: Buffer, /) -> int:
        """Write everything, or store the error."""
        left = memoryview(data).cast("B")
        size = len(left)
        try:
            while left and self.error is None:
                left = left[self._stream.write(left) :]
        except OSError as error:
            self.error = error
        return size

    def truncate(self, size: int | None = None, /) -> int:
        """Set the size of the file, or store the error."""
        try:
            return self._stream.truncate(size)
        except OSError as error:
            self.error = self.error or error
            return 0

    def readinto(self, buffer: WriteableBuffer, /) -> int:
        """Read written data; zeros where writing failed."""
        wanted = memoryview(buffer).cast("B")
        count = self._stream.readinto(wanted) or 0
        wanted[count:] = bytes(len(wanted) - count)
        return len(wanted)

    def seek(self, offset: int, whence: int = io.SEEK_SET, /) -> int:
        """Move to a position."""
        return self._stream.seek(offset, whence)


@contextmanager
def kept(path: Path) -> Iterator[FailingStream]:
    """Open a new file for a library that must not receive errors.

    Raises
    ------
    OSError
        The first error of writing, when the file is closed.
    """
    with FileIO(path, "w+") as stream:
        failing = FailingStream(stream)
        yield failing
    if failing.error is not None:
        raise failing.error
