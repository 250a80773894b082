"""MAT files of level 5 (MATLAB's versions 5 to 7), read and written by SciPy."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bywire.core.errors import FileError, quoted
from bywire.data.file_format import Column, FileFormat, Progress, ReadOptions
from bywire.data.matlab_layout import CLOCKS, NOTES, Part, columns_of, described, parts_of

if TYPE_CHECKING:
    import xarray as xr

_LARGEST = 2**31 - 2**16  # bytes of a variable that the format can hold
_LONGEST = 4096  # characters of a unit or label
_DEEPEST = 8  # structs in structs
_VALUES = 1 << 22  # that are handed over at a time
_NUMBERS = {"double", "single", "logical",
            *(f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64))}  # fmt: skip


class MatSource:
    """An open MAT file; structs become dotted names; cells and objects are left out."""

    def __init__(self, path: Path) -> None:
        from scipy.io import whosmat

        self._path = path
        variables = whosmat(path, appendmat=False)
        name, count = (
            Counter(name for name, _, _ in variables).most_common(1)[0] if variables else ("", 0)
        )
        if count > 1:
            raise FileError(f"{path} holds {quoted(name)} twice: save each variable once")
        self._inner: dict[str, NDArray[Any]] = {}
        self._parts: dict[str, Part] = {}
        texts: dict[str, str] = {}
        for name, shape, kind in variables:
            if kind in _NUMBERS:
                self._parts |= parts_of(name, shape)
            elif kind == "struct":
                self._walk(name, self._variable(name), texts, 0)
        for name, array in self._inner.items():
            self._parts |= parts_of(name, array.shape)
        self.columns: Mapping[str, Column] = columns_of(self._parts, texts)

    def pieces(self, names: Sequence[str]) -> Iterator[tuple[str, int, NDArray[Any]]]:
        """Yield the numbers of some columns."""
        for array in dict.fromkeys(self._parts[name].array for name in names):
            numbers = self._inner[array] if array in self._inner else self._variable(array)
            if numbers.dtype.kind not in "iufb":
                raise FileError(
                    f"{self._path}: {quoted(array)} holds no real numbers: leave it out"
                )
            for name in names:
                part = self._parts[name]
                if part.array == array:
                    column = numbers.reshape(-1) if part.index is None else numbers[:, part.index]
                    for begin in range(0, part.length, _VALUES):
                        yield name, begin, column[begin : begin + _VALUES]

    def _variable(self, name: str) -> NDArray[Any]:
        """Return a variable as MATLAB has it."""
        from scipy.io import loadmat

        variable = loadmat(self._path, variable_names=[name], appendmat=False)[name]
        if not isinstance(variable, np.ndarray):
            raise FileError(f"{self._path} is damaged: {quoted(name)} cannot be read ({variable})")
        return variable

    def _walk(self, name: str, struct: NDArray[Any], texts: dict[str, str], depth: int) -> None:
        """Find arrays and texts in a struct that is no table of structs."""
        if struct.size != 1 or depth > _DEEPEST:
            return
        for field in struct.dtype.names or ():
            value = struct.reshape(-1)[0][field]
            if not isinstance(value, np.ndarray):
                continue
            if value.dtype.names:
                self._walk(f"{name}.{field}", value, texts, depth + 1)
            elif value.dtype.kind == "U" and value.size == 1 and name in (*NOTES, CLOCKS):
                texts[f"{name}.{field}"] = str(value.reshape(-1)[0])[:_LONGEST]
            elif value.dtype.kind in "iufb":
                self._inner[f"{name}.{field}"] = value


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
            f"cannot write {path}: {large!r} has {content[large].nbytes} bytes, more than this "
            "format can hold: use the format mat73"
        )
    progress(f"writing {path.name}", 0.0)
    savemat(
        path, content | texts, appendmat=False, do_compression=True, oned_as="column",
        long_field_names=True,
    )  # fmt: skip
    progress(f"writing {path.name}", 1.0)


FORMAT = FileFormat(
    "mat", "a MAT file of level 5", (".mat",),
    lambda head: head[:19] == b"MATLAB 5.0 MAT-file" or (head[126:128] in (b"IM", b"MI")
    and head[:10] != b"MATLAB 7.3"),
    _open, _write, has_many_axes=True, libraries=("scipy.io.matlab",), counts=("index", 1),
)  # fmt: skip
