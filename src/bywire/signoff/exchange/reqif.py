"""ReqIF: the exchange format of requirements management tools (OMG, version 1.2).

bywire writes results into the bytes of the file, so that everything else survives unchanged. See
``docs/decisions/0043-reqif-in-place.md``.

References
----------
OMG formal/2016-07-01, Requirements Interchange Format (ReqIF), version 1.2.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from xml.sax.saxutils import escape, quoteattr

from bywire.core.errors import FileError, ParameterError, quoted
from bywire.signoff.exchange.requirements_file import (
    LONGEST,
    RESULT_ATTRIBUTES,
    Edit,
    Entry,
    RequirementsFile,
    Result,
    spliced,
)
from bywire.signoff.exchange.xml_tree import Element, parse_xml
from bywire.signoff.xml_text import xml_text

_CONTENT = ("CORE-CONTENT", "REQ-IF-CONTENT")
_OF_OBJECTS = ("IDENTIFIER", "LONG-NAME", "DESC")
_HEADING = "reqif.chaptername"
_TYPE_OF_HEADINGS = "heading"
_ARCHIVE = b"PK\x03\x04"
_XHTML = "http://www.w3.org/1999/xhtml"
_DATATYPE = "bywire-text"

_BLOCKS = (
    *("address", "blockquote", "br", "caption", "dd", "div", "dl", "dt", "hr", "ol", "p", "pre"),
    *("h1", "h2", "h3", "h4", "h5", "h6", "table", "tr", "ul"),
)
_BEFORE = {**dict.fromkeys(_BLOCKS, "\n"), "li": "\n- "}
_AFTER = {**dict.fromkeys(_BLOCKS, "\n"), "li": "\n", "td": " ", "th": " "}
_SPACES = re.compile(r"\s+")


@dataclass(frozen=True)
class _Definition:
    """Definition of an attribute: its identifier, name and kind, such as ``STRING``."""

    identifier: str
    name: str
    kind: str
    line: int


class ReqifFile(RequirementsFile):
    """ReqIF file, in which every object in the specifications is a requirement or a heading.

    Parameters
    ----------
    file
        Its path, for errors.
    content
        Its bytes.

    Raises
    ------
    FileError
        With file and line, if it is not such a file.
    """

    candidates: Mapping[str, tuple[str, ...]] = {
        "id": ("ReqIF.ForeignID", "IDENTIFIER"),
        "text": ("ReqIF.Text", "ReqIF.Name"),
        "source": ("source",),
        "group": ("group",),
        "assumes": ("assumes",),
    }

    def __init__(self, file: Path, content: bytes) -> None:
        super().__init__(file)
        if content.startswith(_ARCHIVE):
            raise FileError(
                f"{file} is an archive (.reqifz), which may contain binary attachments. Extract "
                "it, and specify the .reqif file",
                name=str(file),
                valid=".reqif",
            )
        self._xml = parse_xml(file, content)
        root = self._xml.root
        core = root.first(*_CONTENT)
        if root.name != "REQ-IF" or core is None:
            what = f"<{root.tag}>" if root.name != "REQ-IF" else "no REQ-IF-CONTENT"
            raise FileError(
                f"{file}, line {root.line}: this is not a ReqIF file (it contains {what}). Export "
                "the requirements as ReqIF 1.0 or later",
                name=str(file),
                value=what,
                valid="REQ-IF",
            )
        self._core = core
        self._types = {
            self._identifier(each): each for each in core.every("SPEC-TYPES", "SPEC-OBJECT-TYPE")
        }
        self._definitions = {
            identifier: [self._definition(each) for each in kind.every("SPEC-ATTRIBUTES", "*")]
            for identifier, kind in self._types.items()
        }
        self._by_identifier = {
            each.identifier: each for group in self._definitions.values() for each in group
        }
        self._enumerations = {
            self._identifier(each): each.attributes.get("LONG-NAME", "")
            for kind in core.every("DATATYPES", "DATATYPE-DEFINITION-ENUMERATION")
            for each in kind.every("SPECIFIED-VALUES", "ENUM-VALUE")
        }
        self._objects = self._ordered()

    @property
    def head_line(self) -> int:
        """Line of the object types."""
        return (self._core.first("SPEC-TYPES") or self._core).line

    @property
    def attributes(self) -> Sequence[str]:
        """Names of all attributes of objects."""
        names = [each.name for each in self._by_identifier.values()]
        return list(dict.fromkeys([*names, *_OF_OBJECTS]))

    @cached_property
    def entries(self) -> Sequence[Entry]:
        """Objects in the order of the specifications."""
        return [self._entry(each, group) for each, group in self._objects]

    def with_results(self, results: Mapping[int, Result]) -> bytes:
        """Return the file with results as additional attributes of its objects."""
        used = {self._type(element) for k, (element, _) in enumerate(self._objects) if k in results}
        date = next((each.date for each in results.values()), "")
        edits = list(self._new_definitions(used, date))
        for k, (element, _) in enumerate(self._objects):
            edits += self._new_values(element, results.get(k))
        return self._xml.encoded(spliced(self._xml.data, edits))

    # --- Reading

    def _ordered(self) -> list[tuple[Element, str]]:
        """Return the objects with the headings above them, in the order of the specifications."""
        objects: dict[str, Element] = {}
        for each in self._core.every("SPEC-OBJECTS", "SPEC-OBJECT"):
            identifier = self._identifier(each)
            if identifier in objects:
                raise self._rejected(
                    each,
                    f"IDENTIFIER {quoted(identifier)} appears twice (first in line "
                    f"{objects[identifier].line})",
                    identifier,
                )
            objects[identifier] = each
            self._require_type(each)
        specifications = list(self._core.every("SPECIFICATIONS", "SPECIFICATION"))
        ordered: dict[str, str] = {}
        for each in specifications:
            name = each.attributes.get("LONG-NAME", "") if len(specifications) > 1 else ""
            for identifier, group in self._below(each, (name,) if name else (), objects):
                ordered.setdefault(identifier, group)
        for identifier in objects:
            ordered.setdefault(identifier, "")
        return [
            (objects[identifier], group)
            for identifier, group in ordered.items()
            if not self._is_heading(objects[identifier])
        ]

    def _below(
        self, parent: Element, path: tuple[str, ...], objects: Mapping[str, Element]
    ) -> Iterator[tuple[str, str]]:
        """Yield identifiers of the objects below a specification or an object, with headings."""
        for node in parent.every("CHILDREN", "SPEC-HIERARCHY"):
            reference = node.first("OBJECT", "SPEC-OBJECT-REF")
            identifier = reference.text() if reference is not None else ""
            if identifier not in objects:
                raise self._rejected(
                    node, f"the file contains no SPEC-OBJECT {quoted(identifier)}", identifier
                )
            heading = self._heading(objects[identifier])
            inner = (*path, heading) if heading else path
            yield identifier, " / ".join(inner)
            yield from self._below(node, inner, objects)

    def _heading(self, element: Element) -> str:
        """Return the heading of an object in one line; empty if it is not a heading."""
        values = self._values(element)
        names = (_HEADING, *(("reqif.text", "reqif.name") if self._is_heading(element) else ()))
        return " ".join(next((values[each] for each in names if values.get(each)), "").split())

    def _entry(self, element: Element, group: str) -> Entry:
        attachments: dict[str, tuple[int, str]] = {}
        for value in element.every("VALUES", "ATTRIBUTE-VALUE-XHTML"):
            for each in _attachments(value):
                kind = each.attributes.get("type", "object")
                text = f"{kind} {each.attributes.get('data', '')}".strip()
                attachments.setdefault(self._name(value).casefold(), (each.line, text))
        values = {
            **{name.casefold(): element.attributes.get(name, "") for name in _OF_OBJECTS},
            **self._values(element),
        }
        return Entry(values, element.line, group, bool(values.get(_HEADING)), attachments)

    def _values(self, element: Element) -> dict[str, str]:
        """Return the texts of an object by the names of their attributes in lower case."""
        values: dict[str, str] = {}
        for each in element.every("VALUES", "*"):
            name = self._name(each).casefold()
            if name not in RESULT_ATTRIBUTES and not values.get(name):
                values[name] = self._value_text(each)
        return values

    def _value_text(self, value: Element) -> str:
        if value.name == "ATTRIBUTE-VALUE-XHTML":
            content = value.first("THE-VALUE")
            return _plain_text(content) if content is not None else ""
        if value.name == "ATTRIBUTE-VALUE-ENUMERATION":
            references = [each.text() for each in value.every("VALUES", "ENUM-VALUE-REF")]
            return ", ".join(self._enumerations.get(each, each) for each in references)
        return value.attributes.get("THE-VALUE", "").strip()

    def _name(self, value: Element) -> str:
        """Return the name of a value's attribute."""
        reference = _reference(value)
        known = self._by_identifier.get(reference)
        return known.name if known else reference

    def _identifier(self, element: Element) -> str:
        identifier = element.attributes.get("IDENTIFIER", "")
        if not identifier:
            raise self._rejected(element, f"{element.tag} has no IDENTIFIER", element.tag)
        return identifier

    def _definition(self, element: Element) -> _Definition:
        identifier = self._identifier(element)
        name = element.attributes.get("LONG-NAME") or identifier
        ours = [each for each in RESULT_ATTRIBUTES if identifier.startswith(_prefix(each))]
        definition = _Definition(
            identifier,
            ours[0] if ours else name,
            element.name.removeprefix("ATTRIBUTE-DEFINITION-"),
            element.line,
        )
        if definition.name in RESULT_ATTRIBUTES and definition.kind not in _VALUES:
            raise self._rejected(
                element,
                f"the attribute {quoted(definition.name)}, which contains bywire's results, is not "
                "text. Remove the attribute",
                definition.name,
            )
        return definition

    def _type(self, element: Element) -> str:
        reference = element.first("TYPE", "SPEC-OBJECT-TYPE-REF")
        return reference.text() if reference is not None else ""

    def _require_type(self, element: Element) -> None:
        kind = self._type(element)
        if kind not in self._types:
            raise self._rejected(
                element, f"the file contains no SPEC-OBJECT-TYPE {quoted(kind)}", kind
            )

    def _is_heading(self, element: Element) -> bool:
        kind = self._types[self._type(element)]
        return kind.attributes.get("LONG-NAME", "").casefold() == _TYPE_OF_HEADINGS

    def _rejected(self, element: Element, reason: str, value: str) -> ParameterError:
        return ParameterError(
            f"{self.file}, line {element.line}: {reason}. Export the file again",
            name=element.name,
            value=value,
        )

    # --- Writing

    def _new_definitions(self, types: set[str], date: str) -> Iterator[Edit[bytes]]:
        """Yield the changes that define result attributes in some object types."""
        changed = f'LAST-CHANGE="{date}T00:00:00Z"'
        is_new = False
        for identifier in self._types:
            if identifier not in types:
                continue
            known = {each.name for each in self._definitions[identifier]}
            missing = [name for name in RESULT_ATTRIBUTES if name not in known]
            kind = self._types[identifier]
            mark = kind.tag.removesuffix(kind.name)
            pieces = [
                f"<{mark}ATTRIBUTE-DEFINITION-STRING "
                f"IDENTIFIER={quoteattr(_own_identifier(name, identifier))} {changed} "
                f'LONG-NAME="{name}" IS-EDITABLE="false"><{mark}TYPE>'
                f"<{mark}DATATYPE-DEFINITION-STRING-REF>{_DATATYPE}"
                f"</{mark}DATATYPE-DEFINITION-STRING-REF></{mark}TYPE>"
                f"</{mark}ATTRIBUTE-DEFINITION-STRING>"
                for name in missing
            ]
            if pieces:
                is_new = True
                yield self._added(kind, "SPEC-ATTRIBUTES", pieces)
        known_types = {
            each.attributes.get("IDENTIFIER") for each in self._core.every("DATATYPES", "*")
        }
        if is_new and _DATATYPE not in known_types:
            mark = self._core.tag.removesuffix(self._core.name)
            yield self._added(
                self._core,
                "DATATYPES",
                [
                    f'<{mark}DATATYPE-DEFINITION-STRING IDENTIFIER="{_DATATYPE}" {changed} '
                    f'LONG-NAME="bywire.text" MAX-LENGTH="{LONGEST}"/>'
                ],
            )

    def _new_values(self, element: Element, result: Result | None) -> Iterator[Edit[bytes]]:
        """Yield the changes to an object. Without a result, they clear an earlier result."""
        texts = result.by_attribute() if result is not None else {}
        kind = self._type(element)
        definitions = {each.name: each for each in self._definitions[kind]}
        present = {
            name: each
            for each in element.every("VALUES", "*")
            if (name := self._name(each)) in RESULT_ATTRIBUTES
        }
        mark = element.tag.removesuffix(element.name)
        pieces = []
        for name in RESULT_ATTRIBUTES:
            definition = definitions.get(name) or _Definition(
                _own_identifier(name, kind), name, "STRING", 0
            )
            xml = _value_xml(mark, definition, texts.get(name, ""))
            if name in present:
                yield present[name].start, present[name].end, xml.encode()
            elif result is not None:
                pieces.append(xml)
        if pieces:
            yield self._added(element, "VALUES", pieces)

    def _added(self, parent: Element, name: str, pieces: Sequence[str]) -> Edit[bytes]:
        """Return the change that adds elements at the end of an element, which may be missing."""
        element = parent.first(name)
        if element is None:
            mark = parent.tag.removesuffix(parent.name)
            whole = "".join([f"<{mark}{name}>", *pieces, f"</{mark}{name}>"])
            return self._inside(parent, [whole])
        return self._inside(element, pieces)

    def _inside(self, element: Element, pieces: Sequence[str]) -> Edit[bytes]:
        """Return the change that adds elements at the end of an element."""
        data = self._xml.data
        if element.elements:
            last = element.elements[-1]
            return last.end, last.end, _joined(pieces, self._space_before(last))
        space = self._space_before(element)
        text = _joined(pieces, space + b"  " if space else b"")
        if data.endswith(b"/>", element.start, element.end):
            return element.end - 2, element.end, b">%b%b</%b>" % (text, space, element.tag.encode())
        place = data.rindex(b"</", element.start, element.end)
        return place, place, text

    def _space_before(self, element: Element) -> bytes:
        """Return the line break and the indentation before an element."""
        before = self._xml.data[max(0, element.start - 200) : element.start]
        space = before[len(before.rstrip()) :]
        return space[max(space.rfind(b"\n"), space.rfind(b"\r\n"), 0) :] if b"\n" in space else b""


def _joined(pieces: Sequence[str], space: bytes) -> bytes:
    return b"".join(space + each.encode() for each in pieces)


def _reference(value: Element) -> str:
    """Return the identifier of a value's definition."""
    reference = value.first("DEFINITION", "*")
    return reference.text() if reference is not None else ""


def _own_identifier(name: str, kind: str) -> str:
    """Return the identifier of a definition for results. The type's identifier makes it unique."""
    return f"{_prefix(name)}{kind}"


def _prefix(name: str) -> str:
    return name.replace(".", "-") + "-"


def _string_value(_: str, text: str) -> tuple[str, str]:
    return f" THE-VALUE={quoteattr(text)}", ""


def _xhtml_value(mark: str, text: str) -> tuple[str, str]:
    lines = "<br/>".join(map(escape, text.split("\n")))
    return "", f'<{mark}THE-VALUE><div xmlns="{_XHTML}">{lines}</div></{mark}THE-VALUE>'


_VALUES: Mapping[str, Callable[[str, str], tuple[str, str]]] = {
    "STRING": _string_value,
    "XHTML": _xhtml_value,
}
"""kinds of result attributes: bywire's own kind, and the kind to which some tools convert it"""


def _value_xml(mark: str, definition: _Definition, text: str) -> str:
    kind = definition.kind
    attribute, content = _VALUES[kind](mark, xml_text(text))
    return (
        f"<{mark}ATTRIBUTE-VALUE-{kind}{attribute}><{mark}DEFINITION>"
        f"<{mark}ATTRIBUTE-DEFINITION-{kind}-REF>{escape(definition.identifier)}"
        f"</{mark}ATTRIBUTE-DEFINITION-{kind}-REF></{mark}DEFINITION>{content}"
        f"</{mark}ATTRIBUTE-VALUE-{kind}>"
    )


# --- Formatted text


def _attachments(element: Element) -> Iterator[Element]:
    """Yield objects in formatted text, such as pictures and embedded files."""
    for each in element.elements:
        if each.name.casefold() == "object":
            yield each
        else:
            yield from _attachments(each)


def _plain_text(element: Element) -> str:
    """Return formatted text without its formatting, one line per paragraph."""
    lines = "".join(_pieces(element)).split("\n")
    return "\n".join(line for each in lines if (line := " ".join(each.split())))


def _pieces(element: Element) -> Iterator[str]:
    for each in element.content:
        if isinstance(each, str):
            yield _SPACES.sub(" ", each)
            continue
        name = each.name.casefold()
        if name == "object":
            continue
        yield _BEFORE.get(name, "")
        yield from _pieces(each)
        yield _AFTER.get(name, "")
