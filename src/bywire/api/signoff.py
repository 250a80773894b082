"""Document of a sign-off: requirements with evidence, verdicts, changes and signatures."""

from __future__ import annotations

import math
import os
import platform
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from bywire.cases.identity import as_json, differing
from bywire.core.units import difference_unit
from bywire.report.answer import OUTCOMES, Answer, Outcome, outcome_of
from bywire.report.document import (
    Attachment,
    Banner,
    Block,
    Details,
    Document,
    Listing,
    Paragraph,
    Section,
    TableBlock,
)
from bywire.report.identity import identity, today
from bywire.report.tables import OUTCOMES as OUTCOME_CELLS
from bywire.report.tables import Cell, Column, Table, text_table
from bywire.report.wording import amount, beside_limit, clean, measured_amount
from bywire.signoff.earlier import RECORD
from bywire.signoff.exchange.requirements_file import Result
from bywire.signoff.judging import Judged, judge_limit
from bywire.signoff.junit import TestCase, junit_xml
from bywire.signoff.plan import Evidence, SignOffPlan
from bywire.signoff.statements import Statement
from bywire.signoff.store import EVIDENCE, EvidenceStore, Kept

_LIBRARIES = ("numpy", "scipy", "casadi")
_SHORT = 60  # characters of a requirement in a terminal


# --- Evidence that a person provides


@dataclass(frozen=True)
class ManualEntry(Answer):
    """Statement by a person, with the file that documents it.

    Parameters
    ----------
    what, person, date
        The statement, who made it, and when.
    file, digest
        The file and its SHA-256 digest.
    verdict
        ``met`` or ``missed``, as the person decided.
    """

    what: str
    person: str
    date: str
    file: Path
    digest: str
    verdict: Outcome

    @property
    def outcome(self) -> Outcome:
        """The person's verdict."""
        return self.verdict

    def document(self) -> Document:
        """Return the statement."""
        rows = [
            ("statement", self.what),
            ("person", self.person),
            ("date", self.date),
            ("file", self.file.name),
            ("SHA-256", self.digest),
            ("verdict", self.verdict),
        ]
        table = TableBlock(text_table(("entry", "content"), rows))
        return Document(
            f"Manual entry: {clean(self.what)}",
            "Evidence that a person provides.",
            sections=[Section("Entry", [table])],
            brief=[table],
            data={name.replace("-", "").lower(): value for name, value in rows},
            banner=Banner(f"{self.verdict}: {self.person}, {self.date}, {self.file.name}"),
            record="manual.json",
        )


# --- The sign-off


@dataclass(frozen=True)
class Shown:
    """Evidence with its verdicts.

    Parameters
    ----------
    evidence
        The evidence.
    kept
        Its result, or None if it is missing.
    judged
        One verdict for each limit, or one for the result as a whole.
    """

    evidence: Evidence
    kept: Kept | None
    judged: tuple[Judged, ...]

    @property
    def outcome(self) -> Outcome:
        """The worst verdict."""
        return outcome_of([each.outcome for each in self.judged])

    @property
    def page(self) -> str:
        """Path of its report relative to the document; empty without one."""
        if self.kept is None or not self.kept.page:
            return ""
        return f"{EVIDENCE}/{self.kept.folder}/{self.kept.page}"


@dataclass(frozen=True)
class Verdict:
    """Verdict on a requirement or an assumption.

    Parameters
    ----------
    statement
        The requirement or assumption.
    outcome
        The verdict, including its assumptions.
    shown
        Its evidence.
    reasons
        Reasons for a verdict other than ``met``.
    """

    statement: Statement
    outcome: Outcome
    shown: tuple[Shown, ...]
    reasons: tuple[str, ...]


@dataclass(frozen=True, repr=False)
class SignOff(Answer):
    """Verdicts on all requirements with their evidence.

    Parameters
    ----------
    plan
        The sign-off file.
    folder
        Folder of the evidence.
    kept
        Finished evidence by digest.
    uncomputed
        Reasons for evidence that could not be computed, by digest.
    previous
        JSON object of an earlier sign-off with which this one is compared; empty for none.
    compared_with
        Name of the earlier sign-off.
    """

    plan: SignOffPlan
    folder: Path
    kept: Mapping[str, Kept]
    uncomputed: Mapping[str, str] = field(default_factory=dict)
    previous: Mapping[str, Any] = field(default_factory=dict)
    compared_with: str = ""

    def __repr__(self) -> str:
        return f"<SignOff {self.plan.name}: {self._outcomes()}>"

    @cached_property
    def _shown(self) -> tuple[Shown, ...]:
        return tuple(map(self._judged, self.plan.evidence))

    def _judged(self, evidence: Evidence) -> Shown:
        kept = self.kept.get(evidence.task.digest)
        if kept is None:
            why = self.uncomputed.get(evidence.task.digest, "not computed")
            texts = [str(limit) for limit in evidence.limits] or [""]
            missing = tuple(Judged("not shown", text, note=why) for text in texts)
            return Shown(evidence, None, missing)
        if not evidence.limits:
            whole = (Judged(kept.outcome, note=kept.summary),)
            return Shown(evidence, kept, tuple(kept.judged.values()) or whole)
        judged = tuple(
            kept.judged.get(str(limit)) or judge_limit(limit, kept.figures)
            for limit in evidence.limits
        )
        return Shown(evidence, kept, judged)

    @cached_property
    def verdicts(self) -> dict[str, Verdict]:
        """Verdict on every requirement and assumption, by id."""
        found: dict[str, Verdict] = {}
        statements = {each.id: each for each in self.plan.statements}
        for each in statements.values():
            self._decide(each, statements, found)
        return {name: found[name] for name in statements}

    def _decide(
        self, each: Statement, every: Mapping[str, Statement], found: dict[str, Verdict]
    ) -> Verdict:
        """Return the verdict on a statement. Plans do not contain circular assumptions."""
        if each.id in found:
            return found[each.id]
        shown = tuple(one for one in self._shown if each.id in one.evidence.shows)
        outcome = outcome_of([one.outcome for one in shown])
        reasons = [] if shown else ["no evidence"]
        reasons += [
            f"{judged.limit or one.evidence.task.title}: {_reason(judged)}"
            for one in shown
            for judged in one.judged
            if judged.outcome != "met"
        ]
        for name in each.assumes:
            assumed = self._decide(every[name], every, found)
            if assumed.outcome == "met":
                continue
            reasons.append(f"assumption {name} is {assumed.outcome}")
            outcome = "undecided" if outcome == "met" else outcome
        found[each.id] = Verdict(each, outcome, shown, tuple(reasons))
        return found[each.id]

    @property
    def requirements(self) -> list[Verdict]:
        """Verdicts on the requirements, in the order of the file."""
        return [self.verdicts[each.id] for each in self.plan.requirements]

    @property
    def holds(self) -> bool:
        """Whether every requirement is met."""
        return all(each.outcome == "met" for each in self.requirements)

    @property
    def outcome(self) -> Outcome:
        """The worst verdict on a requirement."""
        return outcome_of([each.outcome for each in self.requirements])

    @property
    def warnings(self) -> list[str]:
        """Warnings from the evidence, and evidence that does not support any requirement."""
        texts = [
            f"{one.evidence.task.title}: {text}"
            for one in self._shown
            if one.kept is not None
            for text in one.kept.warnings
        ]
        return list(dict.fromkeys([*texts, *self._loose()]))

    def _loose(self) -> list[str]:
        return [
            f"{one.evidence.place}: the evidence {one.evidence.task.title!r} does not support any "
            "requirement. Add the key shows, or remove the evidence"
            for one in self._shown
            if not one.evidence.shows
        ]

    def _outcomes(self) -> str:
        outcomes = [each.outcome for each in self.requirements]
        counts = [(outcomes.count(each), each) for each in reversed(OUTCOMES)]
        return ", ".join(f"{count} {each}" for count, each in counts if count)

    # --- The document

    def document(self) -> Document:
        """Return decisions, requirements, evidence, traceability, changes and signatures."""
        plan = self.plan
        open_ones = [each for each in self.verdicts.values() if each.outcome != "met"]
        count = len(self.requirements)
        text = f"{_counted(count, 'requirement')}: {self._outcomes()}"
        word: dict[Outcome, Any] = {"met": "good", "missed": "bad"}
        return Document(
            f"Sign-off: {clean(plan.name)}",
            f"{_counted(count, 'requirement')}, {_counted(len(plan.assumptions), 'assumption')}, "
            f"{_counted(len(plan.evidence), 'piece')} of evidence",
            sections=lambda: [
                Section("Decisions needed", self._decisions(open_ones)),
                *self._groups(),
                *self._assumptions(),
                Section("Evidence", [TableBlock(self._evidence_table(self._shown))]),
                Section("Traceability", self._traceability()),
                *self._warnings_section(),
                Section("Changes", self._changes_blocks()),
                Section("Reproducibility", self._reproducibility()),
                Section("Signatures", self._signatures()),
            ],
            brief=[
                TableBlock(self._brief_table()),
                *([Listing(self._reasons(open_ones), "Decisions needed:")] if open_ones else []),
                Details("", [TableBlock(self._evidence_table(self._shown))]),
            ],
            data=self._data(),
            banner=Banner(text, word.get(self.outcome, "open")),
            attachments=list(self._attachments()),
            record=RECORD,
            remarks=[
                f"requirement {each.statement.id} is {each.outcome}: {'; '.join(each.reasons)}"
                for each in self.requirements
                if each.outcome != "met"
            ],
        )

    def _decisions(self, verdicts: Sequence[Verdict]) -> list[Block]:
        if not verdicts:
            return [Paragraph("None. All requirements are met.")]
        rows = [
            (
                Cell(clean(each.statement.id)),
                OUTCOME_CELLS[each.outcome],
                Cell(clean(each.statement.text)),
                Cell("\n".join(map(clean, each.reasons))),
            )
            for each in sorted(verdicts, key=lambda each: OUTCOMES.index(each.outcome))
        ]
        return [TableBlock(text_table(("id", "verdict", "statement", "reason"), rows))]

    def _reasons(self, verdicts: Sequence[Verdict]) -> list[str]:
        return [
            f"{each.statement.id} {each.outcome}: {'; '.join(each.reasons)}" for each in verdicts
        ]

    def _groups(self) -> list[Section]:
        groups: dict[str, list[Verdict]] = {}
        for each in self.requirements:
            groups.setdefault(each.statement.group, []).append(each)
        return [
            Section(
                clean(group) if group else "Requirements",
                [TableBlock(_matrix(members))],
            )
            for group, members in groups.items()
        ]

    def _assumptions(self) -> list[Section]:
        assumptions = [self.verdicts[each.id] for each in self.plan.assumptions]
        return [Section("Assumptions", [TableBlock(_matrix(assumptions))])] if assumptions else []

    def _brief_table(self) -> Table:
        rows = [
            (
                Cell(clean(each.statement.id)),
                OUTCOME_CELLS[each.outcome],
                Cell(_shortened(clean(each.statement.text))),
            )
            for each in self.verdicts.values()
        ]
        return text_table(("id", "verdict", "statement"), rows)

    def _evidence_table(self, shown: Sequence[Shown]) -> Table:
        rows = [
            (
                Cell(clean(one.evidence.task.title), link=one.page),
                OUTCOME_CELLS[judged.outcome],
                Cell(clean(judged.limit) or "-"),
                Cell(_value(judged), value=judged.value if judged.unit else None),
                Cell(_error(judged), value=judged.error if judged.unit else None),
                Cell(_room(judged), value=judged.room if judged.unit else None),
                Cell(clean("; ".join(filter(None, [judged.at, judged.note]))) or "-"),
                Cell(clean(", ".join(one.evidence.shows)) or "-"),
            )
            for one in shown
            for judged in one.judged
        ]
        headings = ("evidence", "verdict", "limit", "value", "error", "margin", "where", "shows")
        numeric = ("limit", "value", "error", "margin")
        columns = tuple(Column(name, numeric=name in numeric) for name in headings)
        return Table(columns, tuple(rows))

    def _traceability(self) -> list[Block]:
        bare = [each.statement.id for each in self.verdicts.values() if not each.shown]
        loose = self._loose()
        return [
            Listing(
                [clean(each) for each in bare] or ["none"],
                "Requirements and assumptions without evidence:",
            ),
            Listing([clean(each) for each in loose] or ["none"], "Evidence without a requirement:"),
        ]

    def _warnings_section(self) -> list[Section]:
        texts = [clean(text) for text in self.warnings]
        return [Section("Warnings from the evidence", [Listing(texts)])] if texts else []

    def _changes_blocks(self) -> list[Block]:
        if not self.previous:
            return [Paragraph("There is no earlier sign-off to compare with.")]
        where = f"Changes since the sign-off in {clean(self.compared_with)}:"
        return [Listing([clean(text) for text in self.changes] or ["none"], where)]

    @cached_property
    def changes(self) -> list[str]:
        """Changes since the earlier sign-off: texts, verdicts and computations."""
        return list(_changes(self.previous, self._verdicts_data())) if self.previous else []

    def _reproducibility(self) -> list[Block]:
        rows = [
            (Cell(clean(kept.title)), Cell(digest[:16]), Cell(kept.folder))
            for digest, kept in self.kept.items()
        ]
        imported = self.plan.imported
        made = [
            *([f"{clean(imported.file)}: SHA-256 {imported.digest}"] if imported else []),
            *(f"{name} {value}" for name, value in _versions()),
            f"machine: {_machine()}",
            f"{len(self.plan.evidence)} pieces of evidence from {len(self.plan.tasks)} results",
        ]
        table = TableBlock(text_table(("evidence", "digest", "folder"), rows))
        return [Listing(made), Details("Digests of the evidence", [table])]

    def _signatures(self) -> list[Block]:
        headings = ("role", "name", "date", "signature")
        blank = "\n\n"
        rows = [
            (Cell(clean(role)), Cell(blank), Cell(blank), Cell(blank))
            for role in self.plan.signatures
        ]
        return [TableBlock(text_table(headings, rows))]

    # --- Data

    def _data(self) -> dict[str, Any]:
        imported = self.plan.imported
        return {
            "name": self.plan.name,
            "file": str(self.plan.file),
            "imported": (
                {"file": str(imported.file), "sha256": imported.digest} if imported else None
            ),
            "verdict": self.outcome,
            "counts": {
                each: sum(v.outcome == each for v in self.requirements)
                for each in reversed(OUTCOMES)
            },
            **self._verdicts_data(),
            "evidence_without_requirement": [
                _shown_data(one) for one in self._shown if not one.evidence.shows
            ],
            "warnings": self.warnings,
            "since": self.compared_with,
            "changes": self.changes,
            "signatures": list(self.plan.signatures),
            "made": [{"name": name, "value": value} for name, value in self._made()],
        }

    def _made(self) -> Iterator[tuple[str, str]]:
        """Yield date, person, command, versions and machine."""
        yield from identity()
        yield from _versions()
        yield "machine", _machine()

    def _verdicts_data(self) -> dict[str, Any]:
        return {
            "requirements": [_verdict_data(each) for each in self.requirements],
            "assumptions": [
                _verdict_data(self.verdicts[each.id]) for each in self.plan.assumptions
            ],
        }

    def _attachments(self) -> Iterator[Attachment]:
        yield Attachment("junit.xml", self._write_junit)
        if self.plan.imported is not None:
            yield Attachment(self.plan.imported.results_name, self._write_imported)

    def _write_imported(self, path: Path) -> Path:
        assert self.plan.imported is not None
        results = {each.statement.id: _result(each) for each in self.requirements}
        path.write_bytes(self.plan.imported.with_results(results))
        return path

    def _write_junit(self, path: Path) -> Path:
        cases = [
            TestCase(
                each.statement.id,
                each.statement.group,
                each.outcome,
                "; ".join(each.reasons),
                (
                    each.statement.text,
                    *(
                        f"{one.evidence.task.title}: {_in_words(judged)}"
                        for one in each.shown
                        for judged in one.judged
                    ),
                ),
            )
            for each in self.requirements
        ]
        path.write_bytes(junit_xml(self.plan.name, cases))
        return path


def _counted(count: int, noun: str) -> str:
    return f"{count} {noun}{'s' * (count != 1)}"


def _matrix(verdicts: Sequence[Verdict]) -> Table:
    """Return the requirements with their evidence, one row per piece of evidence."""
    rows = []
    for each in verdicts:
        statement = each.statement
        first = (
            Cell(clean(statement.id)),
            OUTCOME_CELLS[each.outcome],
            Cell(clean(statement.text)),
            Cell(clean(statement.source) or "-"),
        )
        blank = (Cell(clean(statement.id)), Cell(""), Cell(""), Cell(""))
        pieces = [(one, judged) for one in each.shown for judged in one.judged]
        if not pieces:
            rows.append((*first, Cell("no evidence"), *(Cell("-"),) * 3))
        for k, (one, judged) in enumerate(pieces):
            rows.append(
                (
                    *(first if k == 0 else blank),
                    Cell(clean(one.evidence.task.title), link=one.page),
                    Cell(clean(judged.limit) or "-"),
                    Cell(_value(judged)),
                    Cell(_room(judged)),
                )
            )
    headings = ("id", "verdict", "statement", "source", "evidence", "limit", "value", "margin")
    return Table(tuple(map(Column, headings)), tuple(rows))


def _reason(judged: Judged) -> str:
    parts = [_value(judged) if judged.unit else "", judged.at, judged.note]
    told = ", ".join(part for part in parts if part and part != "-")
    return told or judged.outcome


def _in_words(judged: Judged) -> str:
    """Return limit, value and verdict in one line."""
    if not judged.unit:
        return f"{judged.outcome}, {judged.note}" if judged.note else judged.outcome
    return f"{judged.limit}: {_value(judged)}, {judged.outcome}"


def _value(judged: Judged) -> str:
    """Return the value, in dB if the limit is in dB."""
    if not judged.unit:
        return "-"
    if _is_in_decibel(judged):
        return f"{_decibel(judged.value):.4g} dB"
    value, error, unit = _beside_limit(judged)
    if value is not None and abs(value) <= error:  # measured_amount would show 0
        return amount(value, unit, 2)
    return measured_amount(value, unit, error)


def _beside_limit(judged: Judged) -> tuple[float | None, float, str]:
    """Return the value, error and unit, in percent if the limit is in percent."""
    limit = judged.limit.partition(" with ")[0]
    return beside_limit(judged.value, judged.error, judged.unit, limit)


def _is_in_decibel(judged: Judged) -> bool:
    return judged.limit.endswith("dB") and judged.value > 0.0


def _decibel(factor: float) -> float:
    return 20.0 * math.log10(factor) if factor < math.inf else math.inf


def _error(judged: Judged) -> str:
    if not judged.unit or not math.isfinite(judged.error) or math.isnan(judged.value):
        return "-"
    value, error, unit = _beside_limit(judged)
    return amount(error, difference_unit(unit), 2, like=_finite(value))


def _room(judged: Judged) -> str:
    if not judged.unit or math.isnan(judged.room):
        return "-"
    if _is_in_decibel(judged):
        is_least = ">" in judged.limit
        bound = judged.value - judged.room if is_least else judged.value + judged.room
        room = _decibel(judged.value) - _decibel(bound)
        return f"{room if is_least else -room:.3g} dB"
    value, _, unit = _beside_limit(judged)
    room = judged.room * (100.0 if unit != judged.unit else 1.0)
    return amount(room, difference_unit(unit), 3, like=_finite(value))


def _finite(value: float | None) -> float | None:
    """Return the value if it determines the unit of the numbers beside it."""
    return value if value is not None and math.isfinite(value) else None


def _shortened(text: str) -> str:
    return text if len(text) <= _SHORT else f"{text[: _SHORT - 3]}..."


def _result(verdict: Verdict) -> Result:
    """Return a verdict for the file from which the requirement comes."""
    pieces = [(one, judged) for one in verdict.shown for judged in one.judged]

    def lines(texts: Iterable[str]) -> str:
        return "\n".join(
            "" if text == "-" else " ".join(clean(text).split()) for text in texts
        ).rstrip("\n")

    return Result(
        verdict.outcome,
        lines(verdict.reasons),
        lines(one.evidence.task.title for one, _ in pieces),
        lines(_value(judged) for _, judged in pieces),
        lines(judged.limit for _, judged in pieces),
        lines(_room(judged) for _, judged in pieces),
        today(),
    )


def _verdict_data(verdict: Verdict) -> dict[str, Any]:
    statement = verdict.statement
    return {
        "id": statement.id,
        "text": statement.text,
        "source": statement.source,
        "group": statement.group,
        "outcome": verdict.outcome,
        "reasons": list(verdict.reasons),
        "assumes": list(statement.assumes),
        "evidence": [_shown_data(one) for one in verdict.shown],
    }


def _shown_data(one: Shown) -> dict[str, Any]:
    return {
        "title": one.evidence.task.title,
        "digest": one.evidence.task.digest,
        "report": one.page,
        "note": one.evidence.note,
        "outcome": one.outcome,
        "verdicts": [each.as_object() for each in one.judged],
    }


# --- Changes

_COMPARED = {"text": "text", "source": "source", "group": "group", "assumes": "assumptions"}
"""entries of a requirement that are compared, with their nouns"""


def _changes(before: Mapping[str, Any], now: Mapping[str, Any]) -> Iterator[str]:
    """Yield the changes between the JSON objects of two sign-offs.

    The earlier object may come from any file, so entries of another form are ignored.
    """
    old, new = _by_id(before), _by_id(now)
    for id, each in new.items():
        if id not in old:
            yield f"{id} is new ({each['outcome']})"
            continue
        earlier = old[id]
        if earlier.get("outcome") != each["outcome"]:
            yield f"{id} is {each['outcome']}; it was {earlier.get('outcome')}"
        for key, noun in _COMPARED.items():
            if earlier.get(key) != each[key]:
                yield f"{id}: {noun}: {_listed(each[key])}. Before: {_listed(earlier.get(key))}"
        limits = _limits(each)
        if (known_limits := _limits(earlier)) != limits:
            yield f"{id}: limits: {_listed(limits)}. Before: {_listed(known_limits)}"
        digests = {one.get("title"): one.get("digest") for one in _entries(earlier, "evidence")}
        for one in each["evidence"]:
            known = digests.pop(one["title"], None)
            if known is None:
                yield f"{id}: the evidence {one['title']!r} is new"
            elif known != one["digest"]:
                yield f"{id}: the evidence {one['title']!r} was computed again"
        for title in digests:
            yield f"{id}: the evidence {title!r} was removed"
    for id in old.keys() - new.keys():
        yield f"{id} was removed"


def _listed(value: Any) -> str:
    """Return a text, or a list of texts, in one line."""
    return ("; ".join(map(str, value)) if isinstance(value, list) else str(value or "")) or "none"


def _limits(requirement: Mapping[str, Any]) -> list[str]:
    """Return the limits of a requirement's evidence."""
    return [
        str(verdict.get("limit"))
        for one in _entries(requirement, "evidence")
        for verdict in _entries(one, "verdicts")
        if verdict.get("limit")
    ]


def _by_id(data: Mapping[str, Any]) -> dict[str, Mapping[str, Any]]:
    rows = [*_entries(data, "requirements"), *_entries(data, "assumptions")]
    return {str(each.get("id")): each for each in rows}


def _entries(data: Mapping[str, Any], key: str) -> list[Mapping[str, Any]]:
    value = data.get(key)
    return [each for each in value if isinstance(each, Mapping)] if isinstance(value, list) else []


def _versions() -> Iterator[tuple[str, str]]:
    yield "Python", platform.python_version()
    for name in _LIBRARIES:
        try:
            yield name, version(name)
        except PackageNotFoundError:
            continue


def _machine() -> str:
    return f"{platform.system()} {platform.machine()}, {os.cpu_count()} cores"


# --- What a change affects


@dataclass(frozen=True)
class Affected(Answer):
    """Evidence that would be computed, and the requirements that it affects.

    Parameters
    ----------
    plan
        The sign-off file.
    store
        Stored evidence.
    """

    plan: SignOffPlan
    store: EvidenceStore

    @cached_property
    def reasons(self) -> dict[str, str]:
        """Reason why evidence must be computed, by its digest."""
        earlier: dict[str, list[Kept]] = {}
        for kept in self.store.every():
            earlier.setdefault(kept.title, []).append(kept)
        return {
            digest: _why(earlier.get(task.title, []), as_json(task.identity))
            for digest, task in self.plan.tasks.items()
            if self.store.kept(task) is None
        }

    @property
    def affected(self) -> dict[str, list[str]]:
        """Requirements and assumptions that the evidence affects, by its digest."""
        return {
            digest: sorted(
                {
                    id
                    for each in self.plan.evidence
                    if each.task.digest == digest
                    for id in (*each.shows, *self._relying(each.shows))
                }
            )
            for digest in self.reasons
        }

    def _relying(self, ids: Sequence[str]) -> Iterator[str]:
        """Yield the statements that rely on assumptions, directly or through others."""
        for each in self.plan.statements:
            if any(id in each.assumes for id in ids):
                yield each.id
                yield from self._relying([each.id])

    def document(self) -> Document:
        """Return the evidence to compute, its reasons, and the affected requirements."""
        tasks, affected = self.plan.tasks, self.affected
        rows = [
            (tasks[digest].title, why, ", ".join(affected[digest]) or "-")
            for digest, why in self.reasons.items()
        ]
        table = TableBlock(text_table(("evidence", "reason", "affects"), rows))
        ids = {id for each in affected.values() for id in each}
        text = (
            f"{len(rows)} of {len(tasks)} results must be computed. Affected requirements and "
            f"assumptions: {len(ids)}"
        )
        return Document(
            f"Changes: {clean(self.plan.name)}",
            text,
            sections=[Section("Evidence to compute", [table])],
            brief=[table] if rows else [],
            data={
                "name": self.plan.name,
                "compute": [
                    {
                        "title": tasks[digest].title,
                        "digest": digest,
                        "reason": why,
                        "affects": affected[digest],
                    }
                    for digest, why in self.reasons.items()
                ],
                "kept": [
                    task.title for digest, task in tasks.items() if digest not in self.reasons
                ],
            },
            banner=Banner(text, "open" if rows else "good"),
            has_files=False,  # so that the folder keeps the document of the last sign-off
        )


_FILE = re.compile(r"files ([^:;]+): [^;]+")


def _why(earlier: Sequence[Kept], identity: Mapping[str, Any]) -> str:
    if not earlier:
        return "not computed yet"
    texts = [differing(kept.identity, identity) for kept in earlier]
    texts = [_FILE.sub(r"\1 has changed", text) for text in texts]  # digests tell a reader nothing
    return min((text for text in texts if text), key=len, default="its result is damaged")
