"""Documents and tables as plain text for terminals and logs."""

from __future__ import annotations

import shutil
import textwrap
from collections.abc import Sequence
from dataclasses import replace

from bywire.core.callers import is_command_line
from bywire.report.document import (
    Block,
    Change,
    Details,
    Document,
    Drawing,
    FigureBlock,
    Listing,
    Paragraph,
)
from bywire.report.tables import Table

WIDTH = 120
"""maximum number of characters in a line of prose"""
GAP = "  "
NARROWEST = 12
"""minimum width of a wrapped column"""
LONGEST_WORD = 40
"""length of the longest word that is never broken"""
LONGEST_VALUE = 60
"""maximum number of characters of a value, such as a table, in a sentence on changes"""


def terminal_text(document: Document, verbose: bool = False) -> str:
    """Return the text of a document for a terminal, without its figures and the verdict.

    ``verbose``: with definitions, explanations and all rows of long tables.
    """
    changed = [_bullet(text) for text in change_texts(document.changes or ())]
    lines: list[str] = []
    for block in document.brief:
        text = _text(block, verbose)
        # Texts are separated by empty lines, even if a hidden one is between them.
        if text or (text == "" and lines and lines[-1]):
            lines.append(text)
    if lines and not lines[-1]:
        lines.pop()
    return "\n".join([*changed, *lines])


def verdict_line(document: Document) -> str:
    """Return the verdict in one line; empty if a document has none."""
    return "" if document.banner is None else f"verdict: {document.banner.text}"


def change_texts(changes: Sequence[Change]) -> list[str]:
    """Return a sentence on the changes of each parameter set and of all defaults."""
    texts: dict[str, list[str]] = {}
    for each in changes:
        now, before = (_shortened(text) for text in (each.now, each.before))
        texts.setdefault(each.of, []).append(f"{each.name} = {now} (was {before})")
    return [f"changed from {of}: {', '.join(each)}" for of, each in texts.items()]


def _shortened(text: str) -> str:
    return text if len(text) <= LONGEST_VALUE else f"{text[:LONGEST_VALUE]}..."


def _text(block: str | Block, verbose: bool) -> str | None:
    """Return a block as text; None for a hidden one."""
    if isinstance(block, str):
        return block
    if isinstance(block, FigureBlock | Drawing):
        return None
    if isinstance(block, Details):
        inner = [text for each in block.blocks if (text := _text(each, verbose)) is not None]
        titled = [block.title, *inner] if block.title else inner
        return "\n".join(titled) if verbose else None
    if isinstance(block, Paragraph):
        return textwrap.fill(block.text, _width())
    if isinstance(block, Listing):
        items = [_bullet(text) for text in block.texts]
        return "\n".join([block.title, *items] if block.title else items)
    table = block.table if verbose else block.table.brief
    rest = 0 if verbose or not block.most else max(len(table.rows) - block.most, 0)
    table = replace(table, rows=table.rows[: len(table.rows) - rest])
    lines = [block.title] if block.title else []
    lines.append(table_text(table, _columns()))
    how = "use --verbose to show them" if is_command_line() else "tables() contains them"
    lines += [f"and {rest} more rows ({how})"] if rest else []
    return "\n".join(lines)


def _columns() -> int:
    """Return the line length of the terminal, or of a log for a pipe."""
    return shutil.get_terminal_size((WIDTH, 24)).columns


def _width() -> int:
    """Return the length of a line of prose: that of the terminal, within readable limits."""
    return max(min(_columns(), WIDTH), 20)


def _bullet(text: str) -> str:
    width = _width()
    return textwrap.fill(
        text,
        width,
        initial_indent="- ",
        subsequent_indent="  ",
        break_long_words=False,
        break_on_hyphens=False,
    )


def table_text(table: Table, width: int = 100) -> str:
    """Return a table as lines of at most ``width`` characters, if its columns allow that.

    The widest columns are wrapped first, between words.
    """
    headings = [column.heading for column in table.columns]
    content = [[cell.text for cell in row] for row in table.rows]
    widths = _widths([headings, *content], width)
    rule = GAP.join("-" * w for w in widths)
    body = [line for row in content for line in _lines(table, row, widths)]
    return "\n".join([*_lines(table, headings, widths), rule, *body])


def _widths(rows: list[list[str]], width: int) -> list[int]:
    """Return the columns' widths: the natural ones, with the widest cut until all fit."""
    widths = [
        max(len(line) for row in rows for line in (row[k].splitlines() or [""]))
        for k in range(len(rows[0]))
    ]
    least = [max(NARROWEST, min(LONGEST_WORD, _longest_word(rows, k))) for k in range(len(widths))]
    available = width - len(GAP) * (len(widths) - 1)
    while sum(widths) > available:
        shrinkable = [k for k, w in enumerate(widths) if w > least[k]]
        if not shrinkable:
            break
        widths[max(shrinkable, key=widths.__getitem__)] -= 1
    return widths


def _longest_word(rows: list[list[str]], column: int) -> int:
    return max((len(word) for row in rows for word in row[column].split()), default=0)


def _lines(table: Table, row: list[str], widths: list[int]) -> list[str]:
    """Return the lines of one row."""
    wrapped = [
        [
            part
            for line in text.splitlines() or [""]
            for part in textwrap.wrap(line, w, break_on_hyphens=False) or [""]
        ]
        for text, w in zip(row, widths, strict=True)
    ]
    height = max(len(parts) for parts in wrapped)
    lines = []
    for k in range(height):
        parts = [parts[k] if k < len(parts) else "" for parts in wrapped]
        aligned = [
            part.rjust(w) if column.numeric else part.ljust(w)
            for part, w, column in zip(parts, widths, table.columns, strict=True)
        ]
        lines.append(GAP.join(aligned).rstrip())
    return lines
