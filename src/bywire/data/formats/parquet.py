"""Parquet: column tables; only the chosen columns are read, in batches of rows."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bywire.core.typing import Progress
from bywire.data.file_format import Column, FileFormat, ReadOptions, library

if TYPE_CHECKING:
    import xarray as xr

_ROWS = 1 << 17  # rows per piece
_LARGEST_FOOTER = 100 * 2**20  # bytes of text in the file's description
_UNIT, _LABEL = b"unit", b"label"
_WHAT = "Parquet files"


class ParquetSource:
    """An open Parquet file."""

    def __init__(self, path: Path, file: Any) -> None:
        self._path = path
        self._file = file
        self.columns = _columns(file)
        kinds = {field.name: str(field.type) for field in file.schema_arrow}
        self._instants = {name for name, kind in kinds.items() if kind.startswith("timestamp")}
        self._origins: dict[str, int] = {}

    def pieces(self, names: Sequence[str]) -> Iterator[tuple[str, int, NDArray[Any]]]:
        """Yield the numbers of some columns; null becomes NaN."""
        begin = 0
        for batch in self._file.iter_batches(
            batch_size=_ROWS, columns=list(names), use_threads=False
        ):
            for name in names:
                yield name, begin, self._numbers(name, batch.column(name))
            begin += batch.num_rows

    def _numbers(self, name: str, column: Any) -> NDArray[Any]:
        """Return the numbers of a batch; time stamps count in their unit from the first one."""
        import pyarrow as pa
        import pyarrow.compute as pc

        if pa.types.is_timestamp(column.type) or pa.types.is_duration(column.type):
            column = column.cast(pa.int64())
        if name in self._instants and column.null_count < len(column):
            # A float would lose the last digits of nanoseconds since 1970.
            first = self._origins.setdefault(name, column.drop_null()[0].as_py())
            column = pc.subtract(column, first)
        if column.null_count:
            column = column.cast(pa.float64(), safe=False)
        return np.asarray(column.to_numpy(zero_copy_only=False))


def _columns(file: Any) -> Mapping[str, Column]:
    import pyarrow as pa

    columns = {}
    names = list(file.schema_arrow.names)
    for field in file.schema_arrow:
        kind = field.type
        is_clock = pa.types.is_timestamp(kind) or pa.types.is_duration(kind)
        is_number = pa.types.is_integer(kind) or pa.types.is_floating(kind)
        if names.count(field.name) > 1 or not (is_number or is_clock or pa.types.is_boolean(kind)):
            continue
        notes = field.metadata or {}
        unit = kind.unit if is_clock else notes.get(_UNIT, b"").decode("utf-8", "replace")
        label = notes.get(_LABEL, b"").decode("utf-8", "replace")
        columns[field.name] = Column(field.name, unit, file.metadata.num_rows, None, label)
    return columns


@contextmanager
def _open(path: Path, options: ReadOptions) -> Iterator[ParquetSource]:
    import pyarrow.parquet as parquet

    with parquet.ParquetFile(
        path,
        buffer_size=1 << 20,
        pre_buffer=False,
        page_checksum_verification=True,
        thrift_string_size_limit=_LARGEST_FOOTER,
    ) as file:
        yield ParquetSource(path, file)


def _write(dataset: xr.Dataset, path: Path, progress: Progress) -> None:
    pa, parquet = library("pyarrow", _WHAT), library("pyarrow.parquet", _WHAT)
    names = ["time", *map(str, dataset.data_vars)]
    fields = [
        pa.field(n, pa.from_numpy_dtype(dataset[n].dtype), metadata=_notes(dataset[n].attrs))
        for n in names
    ]
    schema = pa.schema(fields)
    size = dataset["time"].size
    with parquet.ParquetWriter(
        path, schema, write_page_checksum=True, use_dictionary=False
    ) as writer:
        for begin in range(0, size, _ROWS):
            part = slice(begin, begin + _ROWS)
            arrays = [pa.array(dataset[n].values[part]) for n in names]
            writer.write_batch(pa.record_batch(arrays, schema=schema))
            progress(f"writing {path.name}", min(1.0, (begin + _ROWS) / size))


def _notes(attributes: Mapping[str, Any]) -> dict[bytes, bytes]:
    return {
        _UNIT: str(attributes.get("units", "1")).encode(),
        _LABEL: str(attributes.get("long_name", "")).encode(),
    }


FORMAT = FileFormat(
    "parquet",
    "a Parquet file",
    (".parquet", ".pq"),
    lambda head: head[:4] == b"PAR1",
    _open,
    _write,
    # pyarrow loads pandas with the first numbers; importing it here loads it once, not per file.
    libraries=("pyarrow.parquet", "pyarrow.compute", "pandas"),
)
