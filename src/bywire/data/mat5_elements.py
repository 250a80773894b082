"""The elements of a MAT file of level 5, read without believing what they say of themselves.

Sizes are held against what is there, so that no file makes the reader ask for more memory than
its content can fill (MathWorks, MAT-File Format, chapter 1). SciPy's reader is not used: a damaged
element takes the whole process down with it.
"""

from __future__ import annotations

import struct
import zlib
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from bywire.core.errors import FileError, quoted
from bywire.data.declared_size import require_possible
from bywire.data.mat5_layout import STRUCT, TYPES, Array, array_of, arrays_in_struct, head_of

_HEADER = 128  # bytes of the file
_MATRIX, _COMPRESSED = 14, 15
_LOOK = 4096  # bytes of an element in which its name and shape stand
_LARGEST_STRUCT = 256 * 2**20  # bytes: a struct is looked through as a whole
_ENCODINGS = {1: "latin-1", 2: "latin-1", 4: "utf-16", 16: "utf-8", 17: "utf-16", 18: "utf-32"}


def arrays_of(path: Path) -> list[Array]:
    """Return the arrays of a MAT file, in structs as well; cells and objects are left out.

    Raises
    ------
    FileError
        When an element is damaged, or declares a size that it cannot have.
    """
    found: list[Array] = []
    size = path.stat().st_size
    with path.open("rb") as stream:
        order = _order(path, stream.read(_HEADER))
        position = _HEADER
        while position < size:
            stream.seek(position)
            tag = stream.read(8)
            if len(tag) < 8:
                raise _damaged(path, position, "it ends within an element")
            kind, stored = struct.unpack(f"{order}II", tag)
            if position + 8 + stored > size:
                raise _damaged(path, position, f"{stored} bytes are declared, the file ends before")
            if kind not in (_MATRIX, _COMPRESSED):
                raise _damaged(path, position, f"an element of the type {kind} is no array")
            try:
                content = _Element(path, order, stream, position, kind, stored)
                found += [replace(a, element=position, order=order) for a in content.arrays()]
            except (struct.error, zlib.error, IndexError, ValueError):
                raise _damaged(path, position, "an element makes no sense") from None
            position += 8 + stored
    name, count = Counter(one.name for one in found).most_common(1)[0] if found else ("", 0)
    if count > 1:
        raise FileError(f"{path} holds {quoted(name)} twice: save each variable once")
    return found


def numbers_of(path: Path, array: Array) -> NDArray[Any]:
    """Return the numbers of an array in its shape; they cannot be changed.

    Raises
    ------
    FileError
        When the element is damaged.
    """
    content = _content(path, array)
    kind = np.dtype(f"{array.order}{TYPES[array.kind]}")
    return np.frombuffer(content, dtype=kind).reshape(array.shape, order="F")


def text_of(path: Path, array: Array) -> str:
    """Return the text of an array.

    Raises
    ------
    FileError
        When the element is damaged.
    """
    encoding = _ENCODINGS.get(array.kind, "latin-1")
    if encoding.startswith("utf-") and encoding != "utf-8":
        encoding += "-le" if array.order == "<" else "-be"
    return _content(path, array).decode(encoding, "replace")


def _content(path: Path, array: Array) -> bytes:
    """Return the stored bytes of an array."""
    if not array.size:
        return b""
    with path.open("rb") as stream:
        stream.seek(array.element)
        kind, stored = struct.unpack(f"{array.order}II", stream.read(8))
        if kind == _MATRIX:
            stream.seek(array.begin, 1)
            found = stream.read(array.size)
        else:
            machine = zlib.decompressobj()
            try:
                before = machine.decompress(stream.read(stored), array.begin)
                found = machine.decompress(machine.unconsumed_tail, array.size)
            except zlib.error as error:
                raise _damaged(path, array.element, str(error)) from None
            if len(before) != array.begin:
                found = b""
    if len(found) != array.size:
        raise _damaged(path, array.element, f"{array.name!r} is not complete")
    return found


def _order(path: Path, header: bytes) -> str:
    mark = header[126:128]
    if mark not in (b"IM", b"MI"):
        raise FileError(f"{path} is cut within its header: copy or save it again")
    return "<" if mark == b"IM" else ">"


def _damaged(path: Path, position: int, what: str) -> FileError:
    return FileError(
        f"{path} is a damaged MAT file (at byte {position}: {what}): copy or save it again"
    )


class _Element:
    """A variable: its bytes as far as they are needed."""

    def __init__(
        self, path: Path, order: str, stream: BinaryIO, position: int, kind: int, stored: int
    ) -> None:
        self._path, self._order = path, order
        self._stream, self._position = stream, position
        self._kind, self._stored = kind, stored

    def arrays(self) -> Iterator[Array]:
        """Yield its arrays."""
        data = self._bytes(_LOOK)
        start = 8 if self._kind == _COMPRESSED else 0
        inner = self._stored
        if start:
            kind, inner = struct.unpack_from(f"{self._order}II", data)
            if kind != _MATRIX:
                return
            require_possible(self._path, f"the element at {self._position}", inner, self._stored)
        head = head_of(data, start, self._order)
        if head.kind == STRUCT:
            if inner > _LARGEST_STRUCT:
                raise FileError(
                    f"{self._path}: the struct {quoted(head.name)} has {inner} bytes, and "
                    f"{_LARGEST_STRUCT} are read at most: save its fields as variables, or as "
                    "version 7.3"
                )
            data = self._bytes(inner + start)
            if len(data) < inner + start:
                raise ValueError("it ends before")
            content = memoryview(data)[: start + inner]
            yield from arrays_in_struct(content, start, self._order, head.name, 0)
        elif head.is_read:
            yield array_of(head, head.name, data, self._order, start + inner)

    def _bytes(self, most: int) -> bytes:
        """Return its first bytes, inflated."""
        self._stream.seek(self._position + 8)
        if self._kind == _MATRIX:
            return self._stream.read(min(most, self._stored))
        machine = zlib.decompressobj()
        return machine.decompress(self._stream.read(self._stored), most)
