"""A document as plain text for terminals and logs."""

from __future__ import annotations

import shutil
import textwrap

from bywire.report.document import Document, FigureBlock, Flat, Listing, Paragraph
from bywire.report.table_text import table_text

WIDTH = 100
"""characters of a line of prose"""


def terminal_text(document: Document) -> str:
    """Return what a terminal shows of a document; figures are left out."""
    texts = [_text(block) for block in document.brief if not isinstance(block, FigureBlock)]
    return "\n".join(text for text in texts if text is not None)


def _text(block: str | Flat) -> str:
    if isinstance(block, str):
        return block
    if isinstance(block, Paragraph):
        return textwrap.fill(block.text, WIDTH)
    if isinstance(block, Listing):
        lines = [_bullet(text) for text in block.texts]
        return "\n".join([block.title, *lines] if block.title else lines)
    assert not isinstance(block, FigureBlock)
    text = table_text(block.table, block.width or shutil.get_terminal_size().columns)
    return f"{block.title}\n{text}" if block.title else text


def _bullet(text: str) -> str:
    width = max(min(shutil.get_terminal_size().columns, WIDTH), 20)
    return textwrap.fill(
        text, width, initial_indent="- ", subsequent_indent="  ", break_long_words=False,
        break_on_hyphens=False,
    )  # fmt: skip
