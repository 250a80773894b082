"""Statements of a source and tolerances as tables."""

from __future__ import annotations

from collections.abc import Sequence

from bywire.report.tables import (
    ReproductionRow,
    Table,
    reproduction_table,
    text_table,
    verdict_table,
)
from bywire.report.wording import amount
from bywire.reproduction.item import Item
from bywire.reproduction.tolerance import SHARE, Allowance

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
