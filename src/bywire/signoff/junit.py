"""Verdicts on requirements as JUnit XML, which continuous integration servers show."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from xml.etree import ElementTree

from bywire.report.answer import Outcome
from bywire.signoff.xml_text import xml_text

_TAGS = {"missed": "failure", "undecided": "failure", "not shown": "error"}


@dataclass(frozen=True)
class TestCase:
    """A requirement as a test.

    Parameters
    ----------
    id, group
        Names of the test and its suite.
    outcome
        The verdict.
    message
        Reason for a verdict other than ``met``, in one line.
    lines
        Text of the requirement and its evidence.
    """

    __test__ = False  # not a test of pytest

    id: str
    group: str
    outcome: Outcome
    message: str
    lines: tuple[str, ...]


def junit_xml(name: str, cases: Iterable[TestCase]) -> bytes:
    """Return a JUnit report with one suite per group."""
    suites: dict[str, list[TestCase]] = {}
    for each in cases:
        suites.setdefault(each.group or name, []).append(each)
    root = ElementTree.Element("testsuites", name=xml_text(name))
    for group, members in suites.items():
        tags = [_TAGS.get(each.outcome, "") for each in members]
        suite = ElementTree.SubElement(
            root,
            "testsuite",
            name=xml_text(group),
            tests=str(len(members)),
            failures=str(tags.count("failure")),
            errors=str(tags.count("error")),
        )
        for each, tag in zip(members, tags, strict=True):
            case = ElementTree.SubElement(
                suite, "testcase", classname=xml_text(group), name=xml_text(each.id)
            )
            if tag:
                said = ElementTree.SubElement(
                    case, tag, type=each.outcome, message=xml_text(each.message)
                )
                said.text = xml_text("\n".join(each.lines))
            else:
                ElementTree.SubElement(case, "system-out").text = xml_text("\n".join(each.lines))
    ElementTree.indent(root)
    text: bytes = ElementTree.tostring(root, encoding="utf-8", xml_declaration=True)
    return text + b"\n"
