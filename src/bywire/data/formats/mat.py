"""MAT files of level 5 (MATLAB's versions 5 to 7)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bywire.core.errors import FileError
from bywire.data.file_format import FileFormat, Progress, ReadOptions
from bywire.data.mat5_elements import arrays_of, numbers_of, text_of
from bywire.data.mat5_layout import Array
from bywire.data.matlab_layout import CLOCKS, NOTES, columns_of, described, parts_of

if TYPE_CHECKING:
    import xarray as xr

_LARGEST = 2**31 - 2**16  # bytes of a variable that the format can hold
_LONGEST = 4096  # bytes of a unit or label


class MatSource:
    """An open MAT file."""

    def __init__(self, path: Path, arrays: Sequence[Array]) -> None:
        self._path = path
        self._arrays = {one.name: one for one in arrays}
        self._parts = {
            name: part
            for one in arrays
            if not one.is_text and not one.is_complex
            for name, part in parts_of(one.name, one.shape).items()
        }
        described = tuple(f"{struct}." for struct in (*NOTES, CLOCKS))
        texts = {
            one.name: text_of(path, one)
            for one in arrays
            if one.is_text and one.name.startswith(described) and one.size < _LONGEST
        }
        self.columns = columns_of(self._parts, texts)

    def read(self, names: Sequence[str], progress: Progress) -> dict[str, NDArray[np.float64]]:
        """Return the numbers of some columns."""
        found = {}
        for k, name in enumerate(names):
            part = self._parts[name]
            numbers = numbers_of(self._path, self._arrays[part.array])
            column = numbers.reshape(-1) if part.index is None else numbers[:, part.index]
            found[name] = column.astype(np.float64)
            progress(f"reading {self._path.name}", (k + 1) / len(names))
        return found

    def place(self, name: str, row: int) -> str:
        """Return the index of a value, counted from 1 as in MATLAB."""
        return f"index {row + 1}"


@contextmanager
def _open(path: Path, options: ReadOptions) -> Iterator[MatSource]:
    yield MatSource(path, arrays_of(path))


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
    _open, _write, has_many_axes=True,
)  # fmt: skip
