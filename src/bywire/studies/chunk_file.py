"""The file of a chunk: one Parquet file, whole or not at all, that says whose it is."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from bywire.core.scratch import replacing
from bywire.data.file_format import library
from bywire.studies.chunk import Columns

_WHAT = ("the files of a study", "studies")


def require_pyarrow() -> None:
    """Refuse to go on without the library: nothing could be read, and nothing is damaged.

    Raises
    ------
    FileError
        When it is not installed.
    """
    library("pyarrow", *_WHAT)


def write_chunk(
    path: Path, columns: Columns, units: Mapping[str, str], marks: Mapping[bytes, bytes]
) -> None:
    """Write a chunk's cases.

    Parameters
    ----------
    path
        Its file.
    columns
        Values of each quantity and figure, shape (cases,) each; texts as objects.
    units
        Unit of those that have one.
    marks
        What tells the file from any other.

    Raises
    ------
    FileError
        When pyarrow is not installed.
    OSError
        When the file cannot be written.
    """
    pa, parquet = library("pyarrow", *_WHAT), library("pyarrow.parquet", *_WHAT)
    texts = [name for name, column in columns.items() if column.dtype.kind == "O"]
    arrays = {name: pa.array(column) for name, column in columns.items()}
    fields = [
        pa.field(name, array.type, metadata={b"unit": units.get(name, "1").encode()})
        for name, array in arrays.items()
    ]
    table = pa.table(list(arrays.values()), schema=pa.schema(fields, dict(marks)))
    with replacing(path) as fresh:
        # A dictionary of numbers that all differ would be written in vain.
        parquet.write_table(table, fresh, write_page_checksum=True, use_dictionary=texts)


def read_chunk(path: Path) -> tuple[Columns, Mapping[bytes, bytes]]:
    """Return a chunk's cases as they were written, and what tells its file from any other.

    Raises
    ------
    Exception
        Whatever pyarrow raises of a file that is damaged.
    """
    parquet = library("pyarrow.parquet", *_WHAT)
    # Of one file: what reads folders of them takes three times as long, and loads more.
    with parquet.ParquetFile(path, page_checksum_verification=True, pre_buffer=False) as file:
        table = file.read(use_threads=False)
    columns = {
        name: np.asarray(table.column(name).to_numpy(zero_copy_only=False))
        for name in table.column_names
    }
    return columns, table.schema.metadata or {}
