"""The end of a text table: a number that was cut is told from one that is complete."""

from __future__ import annotations

from pathlib import Path

from bywire.core.errors import FileError, quoted
from bywire.data.text_dialect import Dialect

LOOKED_AT = 1 << 16
"""bytes before the end that are looked at"""

_ROWS = 100  # before the last one that are looked at
_FEWEST = 10


def require_whole_end(path: Path, block: bytes, last_line: int, dialect: Dialect) -> None:
    """Refuse a table that seems to end within its last number.

    Many programs end a table without a line end, and a cut there does not show by itself. It does
    where the last number has fewer decimals than all before it in that column, which have as many
    as each other; where they vary, it is told by being shorter than all of them.

    Parameters
    ----------
    path
        What errors call the file.
    block
        Its last bytes.
    last_line
        Number of the last of them.
    dialect
        How the table is written.

    Raises
    ------
    FileError
        With the line.
    """
    if block.endswith((b"\n", b"\r")):
        return
    separator, mark = dialect.separator.encode(), dialect.decimal.encode()
    cells = [line.rpartition(separator)[2].strip() for line in block.rsplit(b"\n", _ROWS)[1:]]
    if len(cells) <= _FEWEST:
        return
    decimals = [len(cell.partition(mark)[2]) for cell in cells]
    digits = [len(cell.lstrip(b"+-")) for cell in cells]
    is_fixed = decimals[0] > 0 and len(set(decimals[:-1])) == 1
    sizes = decimals if is_fixed else digits
    if sizes[-1] < min(sizes[:-1]):
        more = "have more decimals" if is_fixed else "are longer"
        cell = quoted(cells[-1].decode("utf-8", "replace"))
        raise FileError(
            f"{path}, line {last_line}: it ends with {cell} and without a line end, and all "
            f"numbers before in that column {more}: remove the row if the recording was cut here, "
            "or end it with a line end if it is whole"
        )
