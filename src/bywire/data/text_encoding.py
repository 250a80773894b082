"""Encoding of text files, and their conversion to UTF-8."""

from __future__ import annotations

import codecs
from collections.abc import Iterator
from pathlib import Path

from bywire.core.callers import option
from bywire.core.errors import FileError

ENCODINGS = (
    "utf-8",
    "utf-16",
    "utf-16-le",
    "utf-16-be",
    "cp1252",
    "latin-1",
    "iso-8859-15",
    "cp1250",
    "cp1251",
    "cp437",
    "cp850",
    "mac-roman",
    "shift_jis",
    "gbk",
    "euc-kr",
    "big5",
)
"""encodings of text files that a mapping may specify"""

_BLOCK = 1 << 22  # bytes per block
_MARKS = {
    codecs.BOM_UTF8: "utf-8",
    codecs.BOM_UTF16_LE: "utf-16-le",
    codecs.BOM_UTF16_BE: "utf-16-be",
}
_SHARE = 0.4  # minimum fraction of null bytes at every other position in UTF-16 text


def encoding_of(head: bytes, named: str = "") -> str:
    """Return the encoding of a file from its first bytes.

    Parameters
    ----------
    head
        Its first bytes.
    named
        Encoding that the user specifies; a byte-order mark takes precedence.

    Examples
    --------
    >>> encoding_of("t;p".encode("utf-16")), encoding_of(b"t;p"), encoding_of(b"t;p", "cp1252")
    ('utf-16-le', 'utf-8', 'cp1252')
    """
    for mark, encoding in _MARKS.items():
        if head.startswith(mark):
            return encoding
    if named:
        return "utf-16-le" if named == "utf-16" else named
    for first, encoding in ((1, "utf-16-le"), (0, "utf-16-be")):
        every_other, others = head[first::2], head[1 - first :: 2]
        if every_other and every_other.count(0) > _SHARE * len(every_other) and 0 not in others:
            return encoding
    return "utf-8"


def is_text(head: bytes) -> bool:
    """Return whether the first bytes of a file are text."""
    return b"\0" not in head or encoding_of(head).startswith("utf-16")


def blocks_of(path: Path, encoding: str, size: int = _BLOCK) -> Iterator[bytes]:
    """Yield a text file as UTF-8 blocks, without a byte-order mark.

    Raises
    ------
    FileError
        When it is not text of this encoding, with the line. UTF-8 is checked only when decoded.
    """
    with path.open("rb") as stream:
        head = stream.read(3)
        mark = next((mark for mark in _MARKS if head.startswith(mark)), b"")
        stream.seek(len(mark))
        if encoding == "utf-8":
            while block := stream.read(size):
                yield block
            return
        decoder = codecs.getincrementaldecoder(encoding)()
        lines = 0
        while True:
            block = stream.read(size)
            try:
                text = decoder.decode(block, final=not block)
            except UnicodeDecodeError as error:
                line = lines + 1 + block[: error.start].count(b"\n")
                raise FileError(
                    f"{path}, line {line} is not {encoding} text. Specify the right encoding in "
                    "the mapping, for example encoding = 'cp1252'",
                    name="encoding",
                    value=encoding,
                ) from None
            lines += text.count("\n")
            if text:
                yield text.encode()
            if not block:
                return


def head_text(path: Path, named: str, size: int) -> tuple[list[str], str, bool]:
    """Return the first lines of a text file with line endings, its encoding, whether more follow.

    Raises
    ------
    FileError
        When they are not text in this encoding.
    """
    with path.open("rb") as stream:
        encoding = encoding_of(stream.read(1024), named)
    content = next(blocks_of(path, encoding, size), b"")
    goes_on = path.stat().st_size > size
    if goes_on:
        content = content[: content.rfind(b"\n") + 1]
        if not content:
            raise FileError(
                f"{path}: line 1 is longer than {size} bytes, so this is not a table",
                name=str(path),
            )
    if b"\r" in content and b"\n" not in content:
        raise FileError(
            f"{path}: lines end with CR only. Save the file with LF line endings", name=str(path)
        )
    raw = content.splitlines(keepends=True)
    try:
        return [line.decode() for line in raw], encoding, goes_on
    except UnicodeDecodeError:
        number = next(k for k, line in enumerate(raw, 1) if not _is_utf8(line))
        raise not_utf8(path, number) from None


def not_utf8(path: Path, line: int) -> FileError:
    """Return the error for a line that is not UTF-8."""
    return FileError(
        f"{path}, line {line} is not UTF-8 text. Save it as UTF-8 (in spreadsheets: 'CSV "
        f"UTF-8'). Alternatively, add encoding = 'cp1252' (Windows) or 'latin-1' to the "
        f"mapping, a TOML file ({option('mapping')})",
        name="encoding",
        valid="'cp1252' (Windows) or 'latin-1'",
    )


def _is_utf8(line: bytes) -> bool:
    try:
        line.decode()
    except UnicodeDecodeError:
        return False
    return True
