"""The blocks of an MDF 4 file and the links between them, read safely.

A block names itself, its length and its links (ASAM MDF 4.1, section 5). Nothing is believed: a
block has to lie within the file, be of the kind that is looked for, and stand in one chain once.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from bywire.core.errors import FileError

_HEAD = struct.Struct("<4s4xQQ")
_MOST_LINKS = 1_000_000
_MOST_BLOCKS = 1_000_000  # in chains: a file of an hour has hundreds


@dataclass(frozen=True)
class Block:
    """A block.

    Parameters
    ----------
    kind
        Its two letters.
    address
        Its first byte in the file.
    length
        Its length in bytes, head included.
    links
        Addresses of other blocks, 0 for none.
    content
        Its first bytes behind the links, at most 128.
    """

    kind: str
    address: int
    length: int
    links: tuple[int, ...]
    content: bytes

    @property
    def size(self) -> int:
        """How many bytes are behind its links."""
        return self.length - _HEAD.size - 8 * len(self.links)


class Blocks:
    """The blocks of an open file."""

    def __init__(self, path: Path, stream: BinaryIO) -> None:
        self._path, self._stream = path, stream
        self._size = path.stat().st_size
        self._in_chains: set[int] = set()

    def read(self, address: int, *kinds: str, links: int = 0) -> Block:
        """Return the block at an address, which must be of one of some kinds.

        Raises
        ------
        FileError
            When it is not, has fewer links than needed, or does not lie within the file.
        """
        if not 0 < address <= self._size - _HEAD.size:
            raise self.damaged(address, f"a link leads out of the file of {self._size} bytes")
        self._stream.seek(address)
        mark, length, count = _HEAD.unpack(self._stream.read(_HEAD.size))
        kind = mark[2:].decode("latin-1") if mark[:2] == b"##" else ""
        if kind not in kinds:
            raise self.damaged(address, f"no block of the kind {' or '.join(kinds)} is there")
        least = _HEAD.size + 8 * count
        if count > _MOST_LINKS or not least <= length <= self._size - address:
            raise self.damaged(address, f"a block of {length} bytes does not fit into the file")
        if count < links:
            raise self.damaged(address, f"a block {kind} has {count} links, {links} are needed")
        found = struct.unpack(f"<{count}Q", self._stream.read(8 * count))
        return Block(kind, address, length, found, self._stream.read(min(length - least, 128)))

    def chain(self, address: int, *kinds: str, links: int) -> Iterator[Block]:
        """Yield the blocks of a chain; the first link of each leads to the next.

        Raises
        ------
        FileError
            When a block stands in a chain twice, so that there would be no end.
        """
        while address:
            if address in self._in_chains or len(self._in_chains) >= _MOST_BLOCKS:
                raise self.damaged(address, "its blocks are linked in a circle")
            self._in_chains.add(address)
            block = self.read(address, *kinds, links=links)
            yield block
            address = block.links[0]

    def unpack(self, block: Block, layout: str) -> tuple[int, ...]:
        """Return the fields at the beginning of a block's content.

        Raises
        ------
        FileError
            When the block is too short for them.
        """
        try:
            return struct.unpack_from(f"<{layout}", block.content)
        except struct.error:
            raise self.damaged(block.address, f"a block {block.kind} is too short") from None

    def damaged(self, address: int, what: str) -> FileError:
        """Return the error of a damaged file."""
        return FileError(
            f"{self._path} is a damaged MDF file (at byte {address}: {what}): copy it again, or "
            "repair it with the program that recorded it"
        )
