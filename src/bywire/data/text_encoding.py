"""Encoding of text files, and their conversion to UTF-8."""

from __future__ import annotations

import codecs
import io
import re
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

WINDOWS = "cp1252"
"""encoding of tables that are not UTF-8, unless a mapping specifies another one"""

_BLOCK = 1 << 22  # bytes per block
_MARKS = {
    codecs.BOM_UTF8: "utf-8",
    codecs.BOM_UTF16_LE: "utf-16-le",
    codecs.BOM_UTF16_BE: "utf-16-be",
}
_CONTROLS = re.compile(r"[\x00-\x08\x0e-\x19\x1b-\x1f]")  # not in tables; \x1a ends DOS files
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


def head_text(path: Path, named: str, size: int) -> tuple[list[str], str]:
    """Return the first lines of a text file with line endings, and its encoding.

    Raises
    ------
    FileError
        When they are not text in the specified encoding, in UTF-8 or in Windows encoding.
    """
    with path.open("rb") as stream:
        encoding = encoding_of(stream.read(1024), named)
    content = next(blocks_of(path, encoding, size), b"")
    if path.stat().st_size > size:
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
    try:
        text, used = decoded(content)
    except UnicodeDecodeError as error:
        raise not_text(path, 1 + content[: error.start].count(b"\n")) from None
    return list(io.StringIO(text, newline="")), used or encoding


def decoded(content: bytes) -> tuple[str, str]:
    """Return text of unknown encoding, and the encoding if it is not UTF-8.

    Raises
    ------
    UnicodeDecodeError
        When it is neither UTF-8 nor text in Windows encoding.
    """
    try:
        return content.decode(), ""
    except UnicodeDecodeError as error:
        text = content.decode(WINDOWS, "replace")
        if "\ufffd" in text or _CONTROLS.search(text):
            raise error from None
        return text, WINDOWS


def windows_note() -> str:
    """Return the note that a table is not UTF-8, and how bywire reads it."""
    return (
        f"the text is not UTF-8, so bywire reads it as {WINDOWS} (Windows). If a name or a unit "
        f"looks wrong, add the line encoding = 'cp850' or another encoding to the mapping, a TOML "
        f"file ({option('mapping')})"
    )


def not_text(path: Path, line: int) -> FileError:
    """Return the error for a line that is neither UTF-8 nor text in Windows encoding."""
    valid = ", ".join(ENCODINGS)
    return FileError(
        f"{path}, line {line} is neither UTF-8 nor {WINDOWS} (Windows) text. Save it as UTF-8 (in "
        "spreadsheets: 'CSV UTF-8'). If it is text in another encoding, add the line "
        f"encoding = 'cp850' to the mapping, a TOML file ({option('mapping')}). Valid encodings "
        f"are {valid}",
        name="encoding",
        valid=valid,
    )
