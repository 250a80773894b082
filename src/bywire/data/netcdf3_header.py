"""The header of a classic NetCDF file, looked through before a library reads it.

The library believes the counts in it and asks for as much memory as they say (Unidata, NetCDF
classic format specification).
"""

from __future__ import annotations

import struct
from pathlib import Path
from typing import BinaryIO

from bywire.core.errors import FileError

_CLASSIC = (b"CDF\x01", b"CDF\x02", b"CDF\x05")
_DIMENSIONS, _VARIABLES, _ATTRIBUTES = 10, 11, 12
_SIZES = {1: 1, 2: 1, 3: 2, 4: 4, 5: 4, 6: 8, 7: 1, 8: 2, 9: 4, 10: 8, 11: 8}


def require_sound_header(path: Path) -> None:
    """Refuse a classic NetCDF file whose header does not fit into it; others are let pass.

    Raises
    ------
    FileError
        When a list in the header has more entries than the file has room for.
    """
    with path.open("rb") as stream:
        magic = stream.read(4)
        if magic in _CLASSIC:
            _Header(path, stream, magic[3]).check()


class _Header:
    """The walk through the lists of the header."""

    def __init__(self, path: Path, stream: BinaryIO, version: int) -> None:
        self._path, self._stream = path, stream
        self._size = path.stat().st_size
        self._count = ">Q" if version == 5 else ">I"
        self._begin = ">I" if version == 1 else ">Q"

    def check(self) -> None:
        self._number(self._count)  # of records
        for _ in range(self._list(_DIMENSIONS, 8)):
            self._skip(self._number(self._count), 1)
            self._number(self._count)
        self._attributes()
        for _ in range(self._list(_VARIABLES, 28)):
            self._skip(self._number(self._count), 1)
            for _ in range(self._bounded(self._number(self._count), 4)):
                self._number(self._count)
            self._attributes()
            self._number(">I")
            self._number(self._count)
            self._number(self._begin)

    def _attributes(self) -> None:
        for _ in range(self._list(_ATTRIBUTES, 12)):
            self._skip(self._number(self._count), 1)
            kind = self._number(">I")
            if kind not in _SIZES:
                raise self._damaged(f"an attribute of the type {kind}")
            self._skip(self._number(self._count), _SIZES[kind])

    def _list(self, tag: int, least: int) -> int:
        """Return how many entries a list has, each of some bytes at least."""
        found, count = self._number(">I"), self._number(self._count)
        if found not in (0, tag) or (not found and count):
            raise self._damaged(f"a list of the kind {found} with {count} entries")
        return self._bounded(count, least)

    def _bounded(self, count: int, least: int) -> int:
        if count * least > self._size - self._stream.tell():
            raise self._damaged(f"{count} entries are declared, the file ends before")
        return count

    def _number(self, layout: str) -> int:
        data = self._stream.read(struct.calcsize(layout))
        if len(data) < struct.calcsize(layout):
            raise self._damaged("it ends within its header")
        (number,) = struct.unpack(layout, data)
        return int(number)

    def _skip(self, count: int, width: int) -> None:
        """Pass over values, which end at a multiple of four bytes."""
        self._stream.seek(-(-self._bounded(count, width) * width // 4) * 4, 1)

    def _damaged(self, what: str) -> FileError:
        return FileError(
            f"{self._path} is a damaged NetCDF file (at byte {self._stream.tell()}: {what}): copy "
            "or export it again"
        )
