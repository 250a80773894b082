"""A reproduction as one HTML page."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from bywire.report.document import (
    Banner,
    Block,
    Details,
    FigureBlock,
    Listing,
    Paragraph,
    Section,
    TableBlock,
)
from bywire.report.page import write_page
from bywire.report.tables import ReproductionRow, Table, reproduction_table, text_table
from bywire.report.wording import amount
from bywire.reproduction.in_short import in_short
from bywire.reproduction.item import Item
from bywire.reproduction.reproduction import Reproduction
from bywire.reproduction.tally import tally
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


def write_report(reproduction: Reproduction, path: Path) -> Path:
    """Write the page, whole or not at all.

    Raises
    ------
    FileError
        When it cannot be written.
    """
    items = reproduction.items
    return write_page(
        path,
        f"Reproduction of {reproduction.source}",
        reproduction.citation,
        _sections(reproduction),
        banner=Banner(f"All statements together: {tally(items)}"),
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


def _sections(reproduction: Reproduction) -> list[Section]:
    apart = [item for item in reproduction.items if item.agrees is False]
    sections = [Section("In short", [Listing(in_short(reproduction)), Paragraph(KINDS)])]
    sections += [Section("Disagreements", [TableBlock(statements(apart))])] if apart else []
    for part in reproduction.parts:
        blocks: list[Block] = [Paragraph(part.text)]
        blocks += [FigureBlock(e.figure, e.caption) for e in part.exhibits]
        blocks += [TableBlock(statements(part.items))] if part.items else []
        blocks += [Details(title, [TableBlock(t)]) for title, t in part.appendix.items()]
        sections.append(Section(part.title, blocks))
    if reproduction.allowances:
        sections.append(Section("Tolerances", [TableBlock(_tolerances(reproduction.allowances))]))
    return sections


def _tolerances(allowances: Sequence[Allowance]) -> Table:
    return text_table(
        ("compared", "tolerance", "reason"),
        [(a.what, _size(a), a.reason) for a in allowances],
    )


def _size(allowance: Allowance) -> str:
    if allowance.unit == SHARE:
        return f"{100.0 * allowance.size:g} % of what is stated"
    return amount(allowance.size, allowance.unit)
