"""Statements of a source and tolerances as tables, and their verdicts counted."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from bywire.report.tables import (
    ReproductionRow,
    Table,
    reproduction_table,
    text_table,
    verdict_table,
)
from bywire.report.wording import amount
from bywire.reproduction.item import SHARE, Allowance, Item

KINDS = (
    "Kinds of statements: 'printed' stands in the source's text, tables or equations, or follows "
    "from printed numbers by an equation that the note names; 'reading' is a sentence of the "
    "source that we put as a number, as its note says; 'axis' is the end of a figure's axis, "
    "beyond which the source shows nothing; 'requirement' is one on the design; 'physical "
    "bound' is a limit that we derive; 'ours' is a number without a counterpart. No verdict is "
    "given where nothing is stated, where a value was tuned to the statement, where it went in "
    "as an input, or where another statement is judged instead."
)


def statements(items: Sequence[Item]) -> Table:
    """Return statements as one table."""
    return reproduction_table(map(reproduction_row, items))


def reproduction_row(item: Item) -> ReproductionRow:
    """Return a statement as the row of a table."""
    return ReproductionRow(
        id=item.id,
        stated=item.stated,
        computed=item.computed,
        unit=item.unit,
        tolerance=item.tolerance,
        agrees=item.agrees,
        note=item.note,
        kind=item.kind,
    )


def verdicts(items: Sequence[Item]) -> Table:
    """Return statements as one table for terminals: numbers and verdicts without notes."""
    return verdict_table(map(reproduction_row, items))


def tolerances(allowances: Sequence[Allowance]) -> Table:
    """Return the tolerances in use with their reasons."""
    return text_table(
        ("compared", "tolerance", "reason"),
        [(a.what, _size(a), a.reason) for a in allowances],
    )


def _size(allowance: Allowance) -> str:
    if allowance.unit == SHARE:
        return f"{100.0 * allowance.size:g} % of what is stated"
    return amount(allowance.size, allowance.unit)


@dataclass(frozen=True)
class Tally:
    """Numbers of verdicts."""

    agree: int
    disagree: int
    silent: int

    def __str__(self) -> str:
        return f"{self.agree} agree, {self.disagree} disagree, {self.silent} without verdict"


def tally(items: Iterable[Item]) -> Tally:
    """Count the verdicts."""
    verdicts = [item.agrees for item in items]
    return Tally(verdicts.count(True), verdicts.count(False), verdicts.count(None))


def tallies(items: Iterable[Item]) -> dict[str, Tally]:
    """Count the verdicts of each parameter set, by what follows ``@`` in the ids."""
    listed = list(items)
    names = dict.fromkeys(item.parameter_set for item in listed)
    return {name: tally(i for i in listed if i.parameter_set == name) for name in names}
