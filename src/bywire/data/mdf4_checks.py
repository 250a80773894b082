"""An MDF 4 file, looked through before a library reads it: sizes, links, records."""

from __future__ import annotations

from pathlib import Path

from bywire.core.errors import FileError
from bywire.data.declared_size import DEFLATE, require_possible
from bywire.data.mdf4_blocks import Block, Blocks

_HEADER = 64  # bytes of the identification, before the first block
_LONGEST_TEXT = 10 * 2**20  # bytes
_LARGEST_BLOCK = 2**28  # bytes
_DEEPEST = 6  # channels in channels, conversions in conversions
_MOST_CONVERSIONS = 200_000
_ZSTD = 2**15  # how many bytes one byte of the newer compressions can become
_VLSD, _FORMULA = 1, 3  # group of records of any length; conversion by a formula
_VIRTUAL = (3, 6)  # channels without bytes in the record


def require_sound(path: Path) -> set[int]:
    """Refuse a file that is damaged, or made to exhaust memory or time.

    Returns
    -------
    set of int
        Addresses of the channels whose values a formula converts, which is never evaluated.

    Raises
    ------
    FileError
        With the place and what was found there.
    """
    with path.open("rb") as stream:
        head = stream.read(_HEADER)
        if len(head) < _HEADER:
            raise FileError(f"{path} is cut within its first {_HEADER} bytes: copy it again")
        if head[:8] != b"MDF     ":
            raise FileError(
                f"{path} was not finished: the recorder was stopped before it could write how much "
                "there is; finish it with the program that recorded it"
            )
        if head[8:9] != b"4":
            version = head[8:16].decode("latin-1").strip("\0 ")
            raise FileError(f"{path} is MDF {version}: convert it to MDF 4, as asammdf does")
        return _Checks(path, Blocks(path, stream)).formulas()


class _Checks:
    """The walk along the links."""

    def __init__(self, path: Path, blocks: Blocks) -> None:
        self._path, self._blocks = path, blocks
        self._conversions = 0
        self._formulas: set[int] = set()

    def formulas(self) -> set[int]:
        header = self._blocks.read(_HEADER, "HD", links=6)
        for k, kind in ((1, "FH"), (3, "AT"), (4, "EV")):
            for _ in self._blocks.chain(header.links[k], kind, links=2):
                pass
        for group in self._blocks.chain(header.links[0], "DG", links=4):
            (id_size,) = self._blocks.unpack(group, "B")
            stored = self._data(group.links[2])
            self._text(group.links[3])
            for channels in self._blocks.chain(group.links[1], "CG", links=6):
                self._group(channels, stored, id_size)
        return self._formulas

    def _group(self, group: Block, stored: int, id_size: int) -> None:
        """Check the records of a channel group against the bytes that are there."""
        _, cycles, flags, _, _, size, invalid = self._blocks.unpack(group, "QQHHIII")
        for k in (2, 5):
            self._text(group.links[k])
        self._source(group.links[3])
        if not flags & _VLSD and cycles * (size + invalid + id_size) > stored:
            raise self._blocks.damaged(
                group.address,
                f"{cycles} records of {size + invalid} bytes are declared, {stored} bytes stored",
            )
        self._channels(group.links[1], size, invalid, 0)

    def _channels(self, address: int, size: int, invalid: int, depth: int) -> None:
        if depth > _DEEPEST:
            raise self._blocks.damaged(address, "channels are nested too deeply")
        for one in self._blocks.chain(address, "CN", links=8):
            kind, _, _, bit, first, bits, flags, position = self._blocks.unpack(one, "BBBBIIII")
            if kind not in _VIRTUAL and first + (bit + bits + 7) // 8 > size:
                raise self._blocks.damaged(one.address, "a channel reaches beyond its record")
            if flags & 2 and position // 8 >= invalid:
                raise self._blocks.damaged(one.address, "a mark of invalid values lies nowhere")
            for k in (2, 6, 7):
                self._text(one.links[k])
            self._source(one.links[3])
            if self._converts_by_formula(one.links[4], 0):
                self._formulas.add(one.address)
            if one.links[5] and self._blocks.read(
                one.links[5], "SD", "DZ", "DL", "HL", "CG", "AT", "EV"
            ).kind not in ("CG", "AT", "EV"):
                self._data(one.links[5])
            if one.links[1] and self._blocks.read(one.links[1], "CN", "CA").kind == "CN":
                self._channels(one.links[1], size, invalid, depth + 1)

    def _data(self, address: int) -> int:
        """Return how many bytes of records a data block or a list of them holds, inflated."""
        if not address:
            return 0
        first = self._blocks.read(address, "DT", "SD", "DV", "DZ", "DL", "LD", "HL")
        if first.kind == "HL":
            if not first.links:
                raise self._blocks.damaged(address, "a list has no beginning")
            first = self._blocks.read(first.links[0], "DL", "LD", links=1)
        if first.kind not in ("DL", "LD"):
            return self._held(first)
        total = 0
        for part in self._blocks.chain(first.address, "DL", "LD", links=1):
            for one in part.links[1:]:
                if one:
                    total += self._held(self._blocks.read(one, "DT", "SD", "DV", "DI", "DZ"))
        return total

    def _held(self, block: Block) -> int:
        if block.kind != "DZ":
            return block.size
        _, kind, _, _, size, stored = self._blocks.unpack(block, "2sBBIQQ")
        if stored > block.size - 24:
            raise self._blocks.damaged(block.address, "a compressed block is cut")
        if size > _LARGEST_BLOCK:
            raise FileError(
                f"{self._path}: the compressed block at {block.address} has {size} bytes, and "
                f"{_LARGEST_BLOCK} are read at most, for it is inflated as a whole: write the file "
                "again in smaller blocks"
            )
        ratio = 1 if kind in (0, 1) else _ZSTD // DEFLATE
        require_possible(self._path, f"the block at {block.address}", size, stored * ratio)
        return size

    def _text(self, address: int) -> None:
        if address and self._blocks.read(address, "TX", "MD").length > _LONGEST_TEXT:
            raise self._blocks.damaged(address, "a text is far too long")

    def _source(self, address: int) -> None:
        if address:
            for link in self._blocks.read(address, "SI", links=3).links[:3]:
                self._text(link)

    def _converts_by_formula(self, address: int, depth: int) -> bool:
        """Check a conversion; return whether a formula is in it."""
        if not address:
            return False
        self._conversions += 1
        if depth > _DEEPEST or self._conversions > _MOST_CONVERSIONS:
            raise self._blocks.damaged(address, "conversions are nested without an end")
        block = self._blocks.read(address, "CC", links=4)
        (kind,) = self._blocks.unpack(block, "B")
        for link in block.links[:3]:
            self._text(link)
        found = kind == _FORMULA
        for link in block.links[4:]:
            if link and self._blocks.read(link, "TX", "MD", "CC").kind == "CC":
                found |= self._converts_by_formula(link, depth + 1)
        return found
