"""What is reported: one line per subject and contract."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Any, Literal

from bywire.contracts.evidence import Contract, NotCheckedError, Place, examine, place_of

Outcome = Literal["holds", "broken", "not checked"]


@dataclass(frozen=True)
class Finding:
    """What came out of one contract on one subject.

    Parameters
    ----------
    subject
        Function, class, parameter set or model, for instance ``"plant.dc_motor.balance"``.
    contract
        What it has to keep, for instance ``"units"``.
    outcome
        ``holds``, ``broken``, or ``not checked``.
    text
        What was found, or why it was not checked.
    figure, limit
        Measure and the largest that is admissible; None where the contract has none.
    place
        Line to look at.
    is_error
        Whether an error of the subject kept the contract from being tried.
    """

    subject: str
    contract: str
    outcome: Outcome
    text: str
    place: Place
    figure: float | None = None
    limit: float | None = None
    is_error: bool = False

    def __str__(self) -> str:
        return f"{self.subject}: {self.contract}: {self.outcome}: {self.text} ({self.place})"


@dataclass(frozen=True)
class Demand:
    """One contract that a named subject has to keep."""

    name: str
    subject: str
    on: Any
    contract: Contract
    place: Place | None = None

    def settle(self) -> Finding:
        """Return what comes out."""
        place = self.place or place_of(self.on)
        try:
            evidence = examine(self.contract, self.on, place)
        except NotCheckedError as reason:
            return Finding(self.subject, self.name, "not checked", str(reason), place)
        outcome: Outcome = "holds" if evidence.holds else "broken"
        return Finding(
            self.subject,
            self.name,
            outcome,
            evidence.text,
            evidence.place or place,
            evidence.figure,
            evidence.limit,
            evidence.is_error,
        )


def one_by_cause(findings: Iterable[Finding]) -> Iterator[Finding]:
    """Yield findings in their order, an error as broken once: what else it stops is not checked.

    A parameter that was renamed keeps every contract of a model from being tried, at one line.
    """
    seen: dict[tuple[str, Place], Finding] = {}
    for each in findings:
        first = seen.setdefault((each.text, each.place), each) if each.is_error else each
        if first is each:
            yield each
        else:
            text = f"the error of {first.subject}: {first.contract} comes up here too"
            yield replace(each, outcome="not checked", text=text)


Demands = Iterator[Demand]
