"""MAT files of level 5 (MATLAB versions 5 to 7), read and written by SciPy."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bywire.core.errors import FileError, quoted
from bywire.core.typing import Progress
from bywire.data.file_format import Column, FileFormat, ReadOptions
from bywire.data.matlab_layout import OBJECT, Found, Part, columns_of, described

if TYPE_CHECKING:
    import xarray as xr

_LARGEST = 2**31 - 2**16  # largest size of a variable in the format, bytes
_LONGEST = 4096  # characters of a unit or label
_DEEPEST = 8  # maximum depth of nested structs
_MOST_STRUCTS = 1000  # maximum size of an array of structs
_OPAQUE = ("MatlabOpaque", "MatlabObject", "MatlabFunction")  # classes of SciPy
_REASONS = {
    "cell": "it is an array of cells",
    "opaque": OBJECT,
    "object": OBJECT,
    "sparse": "it is a sparse matrix",
    "function": "it is a function",
}
_VALUES = 1 << 22  # numbers per piece
_NUMBERS = {
    "double",
    "single",
    "logical",
    *(f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)),
}


class MatSource:
    """An open MAT file; structs become dotted names, cells and objects are skipped."""

    def __init__(self, path: Path) -> None:
        from scipy.io import whosmat

        self._path = path
        variables = whosmat(path, appendmat=False)
        name, count = (
            Counter(name for name, _, _ in variables).most_common(1)[0] if variables else ("", 0)
        )
        if count > 1:
            raise FileError(
                f"{path} contains {quoted(name)} twice. Save each variable once", name=name
            )
        self._inner: dict[str, NDArray[Any]] = {}
        found = Found()
        for name, shape, kind in variables:
            if kind in _NUMBERS:
                found.add(name, shape)
            elif kind == "struct":
                self._walk(name, self._variable(name), found, 0)
            elif kind in _REASONS:
                found.left_out[name or "an object"] = _REASONS[kind]
        for name, array in self._inner.items():
            found.add(name, array.shape)
        self.remarks: list[str] = []
        self.left_out: Mapping[str, str] = found.left_out
        self.columns: Mapping[str, Column]
        self.columns, self._parts = columns_of(found, self._is_increasing, self.remarks)

    def pieces(self, names: Sequence[str]) -> Iterator[tuple[str, int, NDArray[Any]]]:
        """Yield the numbers of some columns."""
        for array in dict.fromkeys(self._parts[name].array for name in names):
            numbers = self._inner[array] if array in self._inner else self._variable(array)
            if numbers.dtype.kind not in "iufb":
                raise FileError(
                    f"{self._path}: {quoted(array)} does not contain real numbers. Do not select "
                    "it",
                    name=array,
                )
            for name in names:
                part = self._parts[name]
                if part.array == array:
                    column = _numbers_of(numbers, part)
                    for begin in range(0, part.length, _VALUES):
                        yield name, begin, column[begin : begin + _VALUES]

    def _variable(self, name: str) -> NDArray[Any]:
        """Return a variable in MATLAB's layout."""
        from scipy.io import loadmat

        variable = loadmat(self._path, variable_names=[name], appendmat=False)[name]
        if not isinstance(variable, np.ndarray):
            raise FileError(
                f"{self._path} is damaged: {quoted(name)} cannot be read ({variable})", name=name
            )
        return variable

    def _is_increasing(self, part: Part) -> bool:
        array = self._inner.get(part.array)
        column = _numbers_of(self._variable(part.array) if array is None else array, part)
        return column.dtype.kind in "iuf" and bool(np.all(np.diff(column) > 0))

    def _walk(self, name: str, struct: NDArray[Any], found: Found, depth: int) -> None:
        """Collect arrays and texts in a struct, or in each struct of an array."""
        if depth > _DEEPEST or struct.size > _MOST_STRUCTS:
            found.left_out[name] = "it has too many structs, or they are nested too deeply"
            return
        for k, element in enumerate(struct.reshape(-1), 1):
            of_element = name if struct.size == 1 else f"{name}({k})"
            for field in struct.dtype.names or ():
                value, inner = element[field], f"{of_element}.{field}"
                if not isinstance(value, np.ndarray):
                    continue
                if type(value).__name__ in _OPAQUE:
                    found.left_out[inner] = OBJECT
                elif value.dtype.names:
                    self._walk(inner, value, found, depth + 1)
                elif value.dtype.kind == "U" and value.size == 1:
                    found.texts[inner] = str(value.reshape(-1)[0])[:_LONGEST]
                elif value.dtype.kind == "O" and value.size:
                    found.left_out[inner] = _REASONS["cell"]
                elif value.dtype.kind in "iufb" and value.size == 1:
                    found.scalars[inner] = float(value.reshape(-1)[0])
                elif value.dtype.kind in "iufb":
                    self._inner[inner] = value


def _numbers_of(array: NDArray[Any], part: Part) -> NDArray[Any]:
    if part.index is None:
        return array.reshape(-1)
    return array[part.index, :] if part.is_row else array[:, part.index]


@contextmanager
def _open(path: Path, options: ReadOptions) -> Iterator[MatSource]:
    yield MatSource(path)


def _write(dataset: xr.Dataset, path: Path, progress: Progress) -> None:
    from scipy.io import savemat

    texts = described(dataset, path)
    content: dict[str, Any] = {str(n): v.values for n, v in dataset.variables.items()}
    large = next((n for n, v in content.items() if v.nbytes > _LARGEST), None)
    if large is not None:
        raise FileError(
            f"cannot write {path}: {large!r} has {content[large].nbytes} bytes, which is more than "
            "this format allows. Use the format mat73",
            name=large,
        )
    progress(f"writing {path.name}", 0.0)
    savemat(
        path,
        content | texts,
        appendmat=False,
        do_compression=True,
        oned_as="column",
        long_field_names=True,
    )
    progress(f"writing {path.name}", 1.0)


FORMAT = FileFormat(
    "mat",
    "a MAT file of level 5",
    (".mat",),
    lambda head: (
        head[:19] == b"MATLAB 5.0 MAT-file"
        or (head[126:128] in (b"IM", b"MI") and head[:10] != b"MATLAB 7.3")
    ),
    _open,
    _write,
    has_many_axes=True,
    libraries=("scipy.io.matlab",),
    counts=("index", 1),
)
