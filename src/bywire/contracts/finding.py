"""What is reported: one line per subject and contract."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
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
    """

    subject: str
    contract: str
    outcome: Outcome
    text: str
    place: Place
    figure: float | None = None
    limit: float | None = None

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
            self.subject, self.name, outcome, evidence.text, evidence.place or place,
            evidence.figure, evidence.limit,
        )  # fmt: skip


Demands = Iterator[Demand]
