"""A result's document as Markdown, with its figures as files."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

from bywire.report.document import (
    Block,
    Details,
    Document,
    Drawing,
    FigureBlock,
    Listing,
    Paragraph,
    Section,
    TableBlock,
)
from bywire.report.tables import Table

_SPECIAL = re.compile(r"([\\`*_{}\[\]<>#|$~])")


def plain(text: str) -> str:
    """Return a text with all special characters of Markdown escaped."""
    return _SPECIAL.sub(r"\\\1", " ".join(text.split()))


def table_lines(headings: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    """Return a table of texts that are already Markdown."""
    lines = ["| " + " | ".join(headings) + " |", "|---" * len(headings) + "|"]
    return [*lines, *("| " + " | ".join(row) + " |" for row in rows), ""]


def section_lines(
    sections: Sequence[Section], level: int, figures: Path | None = None
) -> list[str]:
    """Return sections with headings at a level, and draw their figures into a folder.

    Parameters
    ----------
    figures
        Folder of the figures, as vector graphics; without a folder, figures are left out.
    """
    lines: list[str] = []
    for section in sections:
        lines += ["#" * level + " " + plain(section.title), ""]
        lines += block_lines(section.blocks, figures)
    return lines


def block_lines(blocks: Iterable[Block], figures: Path | None = None) -> list[str]:
    """Return blocks without a heading; see `section_lines`."""
    return [line for block in blocks for line in _block(block, figures)]


def document_page(document: Document, figures: Path | None = None) -> str:
    """Return a page with a document's title, summary, outcome and sections."""
    banner = [f"**{plain(document.banner.text)}**", ""] if document.banner else []
    head = [f"# {plain(document.title)}", "", plain(document.summary), "", *banner]
    return "\n".join([*head, *section_lines(document.page, 2, figures)])


def _block(block: Block, figures: Path | None) -> Iterator[str]:
    match block:
        case Paragraph(text):
            yield from (plain(text), "")
        case Listing(texts, title):
            yield from ([plain(title), ""] if title else [])
            yield from (f"- {plain(text)}" for text in texts)
            yield ""
        case TableBlock(table, caption):
            yield from ([f"*{plain(caption)}*", ""] if caption else [])
            yield from _table(table)
        case Drawing(source, caption):
            yield from ("```{raw} html", source(), "```", "", f"*{plain(caption)}*", "")
        case FigureBlock() if figures is not None:
            yield from _figure(block, figures)
        case Details(title, blocks):
            yield from (f"**{plain(title)}**", "")
            for inner in blocks:
                yield from _block(inner, figures)


def _table(table: Table) -> list[str]:
    rows = [[plain(cell.text) for cell in row] for row in table.rows]
    return table_lines([plain(column.heading) for column in table.columns], rows)


def _figure(block: FigureBlock, folder: Path) -> Iterator[str]:
    folder.mkdir(parents=True, exist_ok=True)
    number = len(list(folder.iterdir())) + 1
    file = folder / f"{block.name or 'figure'}-{number}.svg"
    block.figure.savefig(file, metadata={"Date": None})
    yield from (f"```{{figure}} {folder.name}/{file.name}", f":alt: {plain(block.caption)}", "")
    yield from (plain(block.caption), "```", "")
