"""Heads, subelements and structs of a MAT file of level 5, from bytes in memory.

What is not possible raises ValueError, IndexError or struct.error; `mat5_elements` makes one error
of them that names the file (MathWorks, MAT-File Format, chapter 1).
"""

from __future__ import annotations

import math
import struct
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

STRUCT = 2
"""class of a struct"""

TYPES = {
    1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8",
}  # fmt: skip
"""types of stored numbers"""

_CHAR = 4
_NUMERIC = range(6, 16)  # classes double to uint64
_DEEPEST = 8


@dataclass(frozen=True)
class Array:
    """An array of numbers or text in a MAT file.

    Parameters
    ----------
    name
        Its name, behind those of the structs around it and dots.
    shape
        Its shape in MATLAB.
    is_text
        Whether it is text.
    is_complex
        Whether its numbers are complex.
    kind, begin, size
        Type of the stored numbers, and where they lie in the element, inflated.
    element, order
        Where the element begins in the file, and its order of bytes.
    """

    name: str
    shape: tuple[int, ...]
    is_text: bool
    is_complex: bool
    kind: int
    begin: int
    size: int
    element: int = 0
    order: str = "<"


@dataclass(frozen=True)
class Head:
    """Class, shape and name of an array, and where its content begins.

    Parameters
    ----------
    kind
        Class of MATLAB.
    is_complex
        Whether its numbers are complex.
    shape, name
        As in MATLAB.
    end
        First byte behind the head.
    """

    kind: int
    is_complex: bool
    shape: tuple[int, ...]
    name: str
    end: int

    @property
    def is_read(self) -> bool:
        """Whether it holds numbers or text."""
        return self.kind in _NUMERIC or self.kind == _CHAR


def head_of(data: bytes | memoryview, at: int, order: str) -> Head:
    """Return class, shape and name of the array whose content begins at a byte."""
    begin, size, at = _sub(data, at, order)
    if size != 8:
        raise ValueError("no flags")
    (flags,) = struct.unpack_from(f"{order}I", data, begin)
    begin, size, at = _sub(data, at, order)
    if not 8 <= size <= 128:
        raise ValueError("no shape")
    shape = struct.unpack_from(f"{order}{size // 4}i", data, begin)
    if min(shape) < 0:
        raise ValueError("a shape below zero")
    begin, size, at = _sub(data, at, order)
    name = bytes(data[begin : begin + size]).decode("latin-1")
    return Head(flags & 0xFF, bool(flags & 0x800), shape, name, at)


def array_of(head: Head, name: str, data: bytes | memoryview, order: str, end: int) -> Array:
    """Return the array whose numbers follow its head and end at a byte at the latest."""
    kind, begin, size = _tag(data, head.end, order)
    is_text = head.kind == _CHAR
    width = 1 if is_text else np.dtype(TYPES.get(kind, "V0")).itemsize
    if begin + size > end or (not is_text and size != math.prod(head.shape) * width):
        raise ValueError("it has not as many numbers as it says")
    return Array(name, head.shape, is_text, head.is_complex, kind, begin, size)


def _tag(data: bytes | memoryview, at: int, order: str) -> tuple[int, int, int]:
    """Return type, begin and size of a subelement's data."""
    first, second = struct.unpack_from(f"{order}II", data, at)
    if not first >> 16:
        return first, at + 8, second
    if first >> 16 > 4:  # a small one has size, type and data in eight bytes
        raise ValueError("a small element of more than four bytes")
    return first & 0xFFFF, at + 4, first >> 16


def _sub(data: bytes | memoryview, at: int, order: str) -> tuple[int, int, int]:
    """Return begin and size of a subelement's data, and where the next one begins."""
    _, begin, size = _tag(data, at, order)
    if begin + size > len(data):
        raise ValueError("it reaches beyond its end")
    return begin, size, at + 8 if begin == at + 4 else begin + -(-size // 8) * 8


def arrays_in_struct(
    data: memoryview, at: int, order: str, name: str, depth: int
) -> Iterator[Array]:
    """Yield the arrays in a struct whose content begins at a byte."""
    head = head_of(data, at, order)
    begin, size, at = _sub(data, head.end, order)
    (width,) = struct.unpack_from(f"{order}i", data, begin)
    begin, size, at = _sub(data, at, order)
    if not 0 < width <= 64:
        raise ValueError("names of no width")
    count = size // width
    if math.prod(head.shape) * max(count, 1) * 8 > len(data):
        raise ValueError("more fields than bytes")
    fields = [
        bytes(data[begin + k * width : begin + (k + 1) * width]).split(b"\0")[0].decode("latin-1")
        for k in range(count)
    ]
    for k in range(math.prod(head.shape) * count):
        begin, size, at = _sub(data, at, order)
        if size == 0:
            continue
        inner = head_of(data[: begin + size], begin, order)
        dotted = f"{name}.{fields[k % count]}"
        if inner.kind == STRUCT and depth < _DEEPEST and math.prod(head.shape) == 1:
            yield from arrays_in_struct(data[: begin + size], begin, order, dotted, depth + 1)
        elif inner.is_read and math.prod(head.shape) == 1:
            yield array_of(inner, dotted, data, order, begin + size)
