"""Verdicts on requirements as JUnit XML, which continuous integration servers show."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from xml.etree import ElementTree

from bywire.report.answer import Outcome

_FORBIDDEN = re.compile("[^\t\n\r\u0020-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
"""characters that XML 1.0 does not allow"""
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
        Reason for a verdict that is not ``met``, in one line.
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
    root = ElementTree.Element("testsuites", name=_clean(name))
    for group, members in suites.items():
        tags = [_TAGS.get(each.outcome, "") for each in members]
        suite = ElementTree.SubElement(
            root,
            "testsuite",
            name=_clean(group),
            tests=str(len(members)),
            failures=str(tags.count("failure")),
            errors=str(tags.count("error")),
        )
        for each, tag in zip(members, tags, strict=True):
            case = ElementTree.SubElement(
                suite, "testcase", classname=_clean(group), name=_clean(each.id)
            )
            if tag:
                said = ElementTree.SubElement(
                    case, tag, type=each.outcome, message=_clean(each.message)
                )
                said.text = _clean("\n".join(each.lines))
            else:
                ElementTree.SubElement(case, "system-out").text = _clean("\n".join(each.lines))
    ElementTree.indent(root)
    text: bytes = ElementTree.tostring(root, encoding="utf-8", xml_declaration=True)
    return text + b"\n"


def _clean(text: str) -> str:
    return _FORBIDDEN.sub("\N{REPLACEMENT CHARACTER}", text)
