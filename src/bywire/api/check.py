"""Check of a brake, or one of its parts, against every contract."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from bywire.contracts.evidence import Finding
from bywire.report.answer import Answer, Outcome, outcome_of
from bywire.report.document import Banner, Document, Flat, Listing, Section, TableBlock
from bywire.report.tables import Cell, Column, Table
from bywire.report.wording import clean

Progress = Callable[[str, float], None]

_VERDICTS: dict[str, Any] = {"holds": "good", "broken": "bad", "not checked": "none"}
_HEADINGS = ("subject", "contract", "outcome", "what was found")


@dataclass(frozen=True)
class Check(Answer):
    """Outcome of a check.

    Parameters
    ----------
    subject
        Brake, model, element, parameter set, or everything.
    findings
        One finding for each part and contract.
    """

    subject: str
    findings: tuple[Finding, ...]

    @property
    def holds(self) -> bool:
        """Whether there are no broken contracts."""
        return not self.broken

    @property
    def broken(self) -> tuple[Finding, ...]:
        """Findings of broken contracts."""
        return self._with("broken")

    @property
    def not_checked(self) -> tuple[Finding, ...]:
        """Findings of contracts that could not be checked, each with the reason."""
        return self._with("not checked")

    @property
    def outcome(self) -> Outcome:
        """Verdict on the contracts; ``undecided`` if some could not be checked."""
        words: dict[str, Outcome] = {"holds": "met", "broken": "missed"}
        return outcome_of([words.get(each.outcome, "undecided") for each in self.findings])

    def _with(self, outcome: str) -> tuple[Finding, ...]:
        return tuple(f for f in self.findings if f.outcome == outcome)

    def document(self) -> Document:
        """Return all contracts with outcome, figure, limit and source line."""
        kept = len(self._with("holds"))
        counts = [f"{kept} of {len(self.findings)} contracts hold"]
        counts += [f"{len(self.broken)} broken"] if self.broken else []
        counts += [f"{len(self.not_checked)} could not be checked"] if self.not_checked else []
        summary = f"{self.subject}: {', '.join(counts)}"
        if not self.findings:
            summary = f"{self.subject} declares nothing to check. See docs/modeling.md"
        shown = [f for f in self.findings if f.figure is not None and "(" in f.subject]
        brief: list[str | Flat] = [TableBlock(_figures(shown)), ""] if shown else []
        if self.not_checked:
            reasons: dict[tuple[str, str], list[str]] = {}
            for f in self.not_checked:
                reasons.setdefault((f.subject, f.text), []).append(f.contract)
            texts = [f"{who}: {', '.join(what)}: {why}" for (who, why), what in reasons.items()]
            brief += [Listing(texts, "not checked, because"), ""]
        return Document(
            f"Check of {self.subject}",
            "Contracts of elements, parameter sets and models.",
            sections=[
                Section("Broken contracts", [TableBlock(_table(self.broken))]),
                Section("Not checked", [TableBlock(_table(self.not_checked))]),
                Section("All contracts", [TableBlock(_table(self.findings))]),
            ],
            brief=brief,
            data=self._data(),
            banner=Banner(summary, "good" if self.holds else "bad"),
            record="check.json",
            remarks=[
                f"broken contract: {f.subject}: {f.contract}: {f.text}. See {f.place}"
                for f in self.broken
            ],
        )

    def _data(self) -> dict[str, Any]:
        return {
            "subject": self.subject,
            "holds": self.holds,
            "broken": len(self.broken),
            "not_checked": len(self.not_checked),
            "findings": [
                {
                    "subject": f.subject,
                    "contract": f.contract,
                    "outcome": f.outcome,
                    "text": f.text,
                    "figure": f.figure,
                    "limit": f.limit,
                    "file": f.place.file,
                    "line": f.place.line,
                }
                for f in self.findings
            ],
        }


def _figures(findings: list[Finding]) -> Table:
    """Return a table of the measured figures."""
    rows = [
        (
            Cell(clean(f.subject)),
            Cell(f.contract),
            Cell(f"{f.figure:.2g}"),
            Cell(f"{f.limit:g}"),
            Cell(f.outcome, _VERDICTS[f.outcome]),
        )
        for f in findings
    ]
    numeric = ("figure", "limit")
    headings = ("subject", "contract", *numeric, "outcome")
    return Table(tuple(Column(name, name in numeric) for name in headings), tuple(rows))


def _table(findings: tuple[Finding, ...] | list[Finding]) -> Table:
    rows = []
    for f in findings:
        limit = "" if f.limit is None else f" (limit {f.limit:g})"
        statement = f"{f.text}{limit}" if f.outcome != "broken" else f"{f.text}{limit}; {f.place}"
        outcome = Cell(f.outcome, _VERDICTS[f.outcome])
        rows.append((Cell(clean(f.subject)), Cell(f.contract), outcome, Cell(clean(statement))))
    return Table(tuple(Column(heading) for heading in _HEADINGS), tuple(rows))
