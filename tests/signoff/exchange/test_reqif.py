"""ReqIF: requirements and results back, checked with PyPI's reqif, and errors with lines."""

from __future__ import annotations

import os
import random
import re
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

import pytest

from bywire.core.errors import FileError, InputError, ParameterError
from bywire.signoff.exchange import importing, xml_tree
from bywire.signoff.exchange.importing import AttributeNames, Imported, imported_from
from bywire.signoff.exchange.requirements_file import RESULT_ATTRIBUTES, Result
from raising import raises

EXAMPLE = Path(__file__).with_name("brake.reqif")
"""file with headings, formatted texts, comments, and content that bywire does not know"""
REQIF = EXAMPLE.read_text(encoding="utf-8")
HOSTILE = '=1+1 <b>&amp; "ü" \']]>\t\u20ac\x00'
RESULT = Result("missed", "a\nb", HOSTILE, "4 N\n-1 N", "force >= 5 N", "", "2026-11-27")
ONLY = {"Kind": "requirement"}


def line_of(text: str, content: str = REQIF) -> int:
    """Return the line in which a text first occurs."""
    return content[: content.index(text)].count("\n") + 1


def read(file: Path, content: bytes | str = REQIF, **names: str) -> Imported:
    file.write_bytes(content if isinstance(content, bytes) else content.encode())
    return imported_from(file, AttributeNames(**names), {})


def test_headings_of_several_specifications_and_types(tmp_path: Path) -> None:
    second = '<SPECIFICATION IDENTIFIER="_b" LONG-NAME="Pedal"/></SPECIFICATIONS>'
    kind = '<SPEC-OBJECT-TYPE IDENTIFIER="_heading" LONG-NAME="Heading"/></SPEC-TYPES>'
    text = REQIF.replace("</SPECIFICATIONS>", second).replace("</SPEC-TYPES>", kind)
    force, background = read(tmp_path / "a.reqif", text).statements
    assert (force.group, background.group) == ("Brake / 1 Force", "Brake")
    start = text.index('IDENTIFIER="_o3"')
    text = text[:start] + text[start:].replace(">_type<", ">_heading<", 1)
    assert [each.id for each in read(tmp_path / "a.reqif", text).statements] == ["R-Ü 1"]


def elements_of(content: bytes) -> list[str]:
    """Return every element of a file in its order, with attributes and text."""
    return [
        f"{each.tag} {each.attrib} {(each.text or '').strip()}"
        for each in ElementTree.fromstring(content).iter()
    ]


def test_objects_are_requirements_in_the_order_of_the_specification(tmp_path: Path) -> None:
    force, background = read(tmp_path / "a.reqif").statements
    assert (force.id, background.id) == ("R-Ü 1", "_o3")
    assert force.text == "The force is <large>:\n- dry\n- wet"
    assert (force.group, background.group) == ("1 Force", "")
    assert force.place.line == line_of('IDENTIFIER="_o2"')
    (only,) = imported_from(EXAMPLE, AttributeNames(), ONLY).statements
    assert only.id == force.id
    named = imported_from(EXAMPLE, AttributeNames(id="IDENTIFIER", text="LONG-NAME"), ONLY)
    assert [(each.id, each.text) for each in named.statements] == [("_o2", "F < 2 N")]


def test_results_are_attributes_and_everything_else_stays_as_it_is(tmp_path: Path) -> None:
    file = read(tmp_path / "a.reqif")
    written = file.with_results({"R-Ü 1": RESULT})
    rest = iter(written.decode())
    assert all(character in rest for character in REQIF)  # in this order
    before, after = elements_of(REQIF.encode()), elements_of(written)
    left = iter(after)
    assert all(each in left for each in before)
    assert len(after) - len(before) == 1 + len(RESULT_ATTRIBUTES) * (3 + 3)

    again = read(tmp_path / "b.reqif", written)
    assert [(each.id, each.text, each.group) for each in again.statements] == [
        (each.id, each.text, each.group) for each in file.statements
    ]
    assert again.with_results({"R-Ü 1": RESULT}) == written
    other = again.with_results({"_o3": RESULT})
    assert len(re.findall(b'THE-VALUE="missed"', other)) == 1
    assert read(tmp_path / "c.reqif", other).with_results({"_o3": RESULT}) == other


def test_another_library_reads_the_results(tmp_path: Path) -> None:
    from reqif.parser import ReqIFParser

    written = read(tmp_path / "a.reqif").with_results({"R-Ü 1": RESULT, "_o3": RESULT})
    bundle = ReqIFParser.parse_from_string(written.decode())
    (kind,) = bundle.core_content.req_if_content.spec_types[:1]
    names = {each.identifier: each.long_name for each in kind.attribute_definitions}
    for identifier in ("_o2", "_o3"):
        values = bundle.get_spec_object_by_ref(identifier).attributes
        found = {names[each.definition_ref]: each.value for each in values}
        assert found["bywire.verdict"] == "missed"
        assert found["bywire.evidence"] == HOSTILE.replace("\x00", "\ufffd")
        assert found["bywire.value"] == RESULT.value


def test_the_file_with_results_is_valid(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import reqif
    import xmlschema

    written = read(tmp_path / "a.reqif").with_results({"R-Ü 1": RESULT, "_o3": RESULT})
    monkeypatch.chdir(reqif.PATH_TO_REQIF_ROOT)  # where the schema finds its parts
    schema = xmlschema.XMLSchema(  # 2 s, for an independent verdict on the whole file
        os.path.join("reqif", "reqif_schema", "reqif.xsd")
    )
    schema.validate(REQIF)
    schema.validate(written.decode())


def without(name: str, instead: str, text: str) -> str:
    return re.sub(rf"<{name}>\n.*?\n +</{name}>", instead, text, flags=re.DOTALL)


@pytest.mark.parametrize(
    "change",
    [
        lambda text: text.replace("\n", "\r\n"),
        lambda text: re.sub(r">\s+<", "><", text),
        lambda text: re.sub("<(/?)([A-Z][A-Z-]+)", r"<\1r:\2", text).replace("xmlns=", "xmlns:r="),
        lambda text: without("VALUES", "<VALUES/>", text),
        lambda text: without("VALUES", "<VALUES><!-- none --></VALUES>", text),
        lambda text: without("SPEC-ATTRIBUTES", "", without("VALUES", "", text)),
        lambda text: without("DATATYPES", "", text),
    ],
)
def test_any_layout(tmp_path: Path, change: Callable[[str], str]) -> None:
    content = change(REQIF).encode()
    names = {"id": "IDENTIFIER", "text": "IDENTIFIER"}
    file = read(tmp_path / "a.reqif", content, **names)
    results = {"_o2": RESULT, "_o3": RESULT}
    written = file.with_results(results)
    assert written.count(b'THE-VALUE="missed"') == 2
    left = iter(elements_of(written))
    assert all(each in left for each in elements_of(content))
    assert read(tmp_path / "b.reqif", written, **names).with_results(results) == written


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-16-be", "iso-8859-1"])
def test_the_encoding_stays(tmp_path: Path, encoding: str) -> None:
    text = REQIF.replace("UTF-8", encoding.removesuffix("-sig").removesuffix("-be"))
    text = f"\ufeff{text}" if encoding == "utf-16-be" else text
    file = read(tmp_path / "a.reqif", text.encode(encoding))
    written = file.with_results({"R-Ü 1": RESULT})
    assert written[:4] == text.encode(encoding)[:4]
    rest = iter(written.decode(encoding))
    assert all(character in rest for character in text)
    again = read(tmp_path / "b.reqif", written)
    assert again.with_results({"R-Ü 1": RESULT}) == written
    assert ElementTree.fromstring(written) is not None


def test_results_follow_a_tool_that_formats_or_renames_them(tmp_path: Path) -> None:
    written = read(tmp_path / "a.reqif").with_results({"R-Ü 1": RESULT}).decode()
    start = written.index('IDENTIFIER="bywire-verdict-_type"')
    start = written.rindex("<", 0, start)
    end = written.index("</ATTRIBUTE-DEFINITION-STRING>", start)
    renamed = written[start:end].replace("bywire.verdict", "Verdict").replace("STRING", "XHTML")
    text = f"{written[:start]}{renamed}</ATTRIBUTE-DEFINITION-XHTML>{written[end + 30 :]}"
    again = read(tmp_path / "b.reqif", text).with_results({"R-Ü 1": RESULT})
    assert again.count(b"missed") == 1
    assert b"<THE-VALUE><div" in again
    assert b'LONG-NAME="Verdict"' in again
    assert read(tmp_path / "c.reqif", again).with_results({"R-Ü 1": RESULT}) == again
    with raises(ParameterError, value="bywire.verdict"):
        read(tmp_path / "b.reqif", text.replace("-XHTML", "-REAL"))


_OBJECT = '<x:object data="a.ole" type="application/octet-stream"/>'
_BOMB = '<!DOCTYPE a [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;">]>'


@pytest.mark.parametrize(
    ("old", "new", "kind", "line"),
    [
        ("<REQ-IF ", f"{_BOMB}<REQ-IF ", FileError, line_of("<REQ-IF ")),
        ("<REQ-IF ", '<!DOCTYPE a SYSTEM "a.dtd"><REQ-IF ', FileError, line_of("<REQ-IF ")),
        ("Brake &amp;", "Brake &b;", FileError, line_of("Brake &amp;")),
        ("</THE-HEADER>", "", FileError, line_of("</REQ-IF>")),
        ("<x:p>Background.", f"<x:p>{_OBJECT}", FileError, line_of("Background.")),
        ("UTF-8", "hex", FileError, 1),
        ("<SPEC-OBJECT-TYPE-REF>_type", "<SPEC-OBJECT-TYPE-REF>_x", ParameterError, 0),
        ("<SPEC-OBJECT-REF>_o3", "<SPEC-OBJECT-REF>_x", ParameterError, line_of('"_h3"')),
        ('"_o3"', '"_o2"', ParameterError, line_of('"_o3"')),
        ('IDENTIFIER="_o3" ', "", ParameterError, line_of('"_o3"')),
        ("<x:p>Background.", "<x:p>", ParameterError, line_of('"_o3"')),
        ('"R-Ü 1"', '"R&#10;1"', ParameterError, line_of('"_o2"')),
        ("<x:p>", "<x:p>" * 300, FileError, line_of("<x:p>")),
        ("REQ-IF-CONTENT>", "OTHER>", FileError, line_of("<REQ-IF ")),
    ],
)
def test_a_wrong_file_gets_one_message_with_its_line(
    tmp_path: Path, old: str, new: str, kind: type[InputError], line: int
) -> None:
    assert old in REQIF
    with pytest.raises(kind) as caught:
        read(tmp_path / "a.reqif", REQIF.replace(old, new))
    line = line or line_of('"_o2"')
    assert f"a.reqif, line {line}: " in str(caught.value)


def test_a_damaged_file_is_rejected_with_its_line_or_returns(tmp_path: Path) -> None:
    choose = random.Random(3)
    parts = [
        *re.findall("<[^>]*>", REQIF),
        *re.findall(' [A-Z-]+="[^"]*"', REQIF) * 3,
        *(match[0] for match in re.finditer(r"<([A-Z-]+)( [^>]*)?>[^<]*</\1>", REQIF)),
    ]
    file, rejected, returned = tmp_path / "a.reqif", [], 0
    for _ in range(200):
        text = REQIF.replace(choose.choice(parts), choose.choice(["", choose.choice(parts)]), 1)
        try:
            found = read(file, text, id="IDENTIFIER")
        except InputError as error:
            rejected.append(str(error))
            continue
        results = {each.id: RESULT for each in found.statements}
        written = found.with_results(results)
        assert read(file, written, id="IDENTIFIER").with_results(results) == written
        returned += 1
    assert all("a.reqif, line " in text for text in rejected)
    assert min(len(rejected), returned) > 40


def test_archives_and_large_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with raises(FileError, valid=".reqif"):
        read(tmp_path / "a.reqif", b"PK\x03\x04 any")
    with raises(FileError, name="a.reqif"):
        read(tmp_path / "a.reqif", b"\x89PNG\xff")
    monkeypatch.setattr(importing, "LARGEST", 1000)
    with raises(FileError, name="a.reqif") as caught:
        read(tmp_path / "a.reqif")
    assert "1 kB" in str(caught.value)


def test_nothing_outside_the_file_is_read(tmp_path: Path) -> None:
    (tmp_path / "secret").write_text("secret")
    external = f'<!DOCTYPE a [<!ENTITY s SYSTEM "{(tmp_path / "secret").as_uri()}">]><a>&s;</a>'
    with raises(FileError, name="a.xml"):
        xml_tree.parse_xml(tmp_path / "a.xml", external.encode())
