"""Untrusted XML files as trees, in which every element has its line and its place in the file.

The parser rejects files with a document type declaration. Therefore, entities never expand, and the
parser reads nothing outside the file.
"""

from __future__ import annotations

import codecs
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import NoReturn
from xml.parsers import expat

from bywire.core.errors import FileError
from bywire.data.text_encoding import ENCODINGS, encoding_of

_DEEPEST = 200  # levels of elements
_TEXT = {codecs.lookup(each).name for each in (*ENCODINGS, "ascii")}
_DECLARED = re.compile(rb"""<\?xml[^>]*\bencoding\s*=\s*["']([A-Za-z][\w.-]*)["']""")


@dataclass(slots=True)
class Element:
    """Element of a file.

    Parameters
    ----------
    tag
        Name with its prefix.
    attributes
        Attributes by name with prefix.
    line
        Its line.
    start, end
        Its first byte, and the byte after its last one, in the file as UTF-8.
    content
        Elements and texts in it.
    """

    tag: str
    attributes: dict[str, str]
    line: int
    start: int
    end: int = 0
    content: list[Element | str] = field(default_factory=list)

    @property
    def name(self) -> str:
        """Name without prefix."""
        return self.tag.rpartition(":")[2]

    @property
    def elements(self) -> list[Element]:
        """Elements directly in it."""
        return [each for each in self.content if isinstance(each, Element)]

    def every(self, *names: str) -> Iterator[Element]:
        """Yield the elements on a path of names, each inside the previous one; * is any name."""
        first, *rest = names
        for each in self.elements:
            if first in ("*", each.name):
                yield from each.every(*rest) if rest else (each,)

    def first(self, *names: str) -> Element | None:
        """Return the first element on a path of names, or None."""
        return next(self.every(*names), None)

    def text(self) -> str:
        """Return its text without surrounding white space."""
        return "".join(each for each in self.content if isinstance(each, str)).strip()


@dataclass(frozen=True)
class XmlFile:
    """Content of an XML file.

    Parameters
    ----------
    root
        Outermost element.
    data
        The file as UTF-8.
    encoding
        Encoding of the file.
    """

    root: Element
    data: bytes
    encoding: str

    def encoded(self, data: bytes) -> bytes:
        """Return a changed file in the encoding of this one."""
        return data.decode().encode(self.encoding, "xmlcharrefreplace")


def parse_xml(file: Path, content: bytes) -> XmlFile:
    """Parse the content of a file.

    Raises
    ------
    FileError
        With file and line, if the content is not XML, contains a document type declaration, or is
        nested too deeply.
    """
    encoding = _encoding(content)
    try:
        if codecs.lookup(encoding).name not in _TEXT:
            raise LookupError
        data = content.decode(encoding).encode()
    except (UnicodeError, LookupError):
        raise FileError(
            f"{file}, line 1: bywire cannot decode the file as {encoding}. Export it as UTF-8",
            name=str(file),
            value=encoding,
            valid="UTF-8",
        ) from None
    return XmlFile(_Reader(file, data).root(), data, encoding)


def _encoding(content: bytes) -> str:
    """Return the encoding of an XML file. A byte-order mark is part of the text."""
    encoding = encoding_of(content[:1024])
    declared = _DECLARED.match(content)
    return declared[1].decode() if encoding == "utf-8" and declared else encoding


class _Reader:
    """Parser events, from which this class builds the tree."""

    def __init__(self, file: Path, data: bytes) -> None:
        self._file, self._data = file, data
        self._open: list[Element] = []
        self._root: Element | None = None
        parser = self._parser = expat.ParserCreate("utf-8")
        parser.buffer_text = True
        parser.StartElementHandler = self._start
        parser.EndElementHandler = self._end
        parser.CharacterDataHandler = self._text
        parser.StartDoctypeDeclHandler = self._doctype

    def root(self) -> Element:
        try:
            self._parser.Parse(self._data, True)
        except expat.ExpatError as error:
            last = self._open[-1] if self._open else None
            where = f", in <{last.tag}> from line {last.line}" if last else ""
            raise FileError(
                f"{self._file}, line {error.lineno}: the file is not valid XML "
                f"({expat.errors.messages[error.code]}{where}). Export the file again",
                name=str(self._file),
            ) from None
        assert self._root is not None
        return self._root

    def _start(self, tag: str, attributes: dict[str, str]) -> None:
        parser = self._parser
        element = Element(tag, attributes, parser.CurrentLineNumber, parser.CurrentByteIndex)
        if self._open:
            self._open[-1].content.append(element)
        else:
            self._root = element
        if len(self._open) == _DEEPEST:
            self._reject(f"elements are nested more than {_DEEPEST} levels deep")
        self._open.append(element)

    def _end(self, _: str) -> None:
        element = self._open.pop()
        index = self._parser.CurrentByteIndex
        if element.content or not self._data.endswith(b"/>", element.start, index):
            index = self._data.index(b">", index) + 1
        element.end = index

    def _text(self, text: str) -> None:
        self._open[-1].content.append(text)

    def _doctype(self, *_: object) -> None:
        self._reject(
            "the file contains a document type declaration (<!DOCTYPE ...>), which could read "
            "other files. Remove the declaration"
        )

    def _reject(self, reason: str) -> NoReturn:
        raise FileError(
            f"{self._file}, line {self._parser.CurrentLineNumber}: {reason}", name=str(self._file)
        )
