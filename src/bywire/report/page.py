"""Self-contained HTML file of a report, which loads nothing and escapes all text.

Its only script lets readers zoom into figures. Without the script, no content is missing.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from html import escape
from importlib.resources import files
from itertools import count
from pathlib import Path
from urllib.parse import quote

from bywire.core.version import __version__
from bywire.report.document import (
    Banner,
    Block,
    Details,
    Document,
    Drawing,
    FigureBlock,
    Listing,
    Paragraph,
    Section,
    flat_blocks,
)
from bywire.report.drawing import inline_figures, write_bytes
from bywire.report.inline_script import admitted, bare
from bywire.report.result_folder import listed
from bywire.report.tables import Cell, Column, Table
from bywire.report.wording import clean

_SHORT = 12  # characters of a name that stays in one line
_MANY = 7  # columns from which a table may be wider than text
_MARKS = {"good": "✓ ", "bad": "✗ ", "open": "? ", "none": ""}


def write_page(
    path: str | os.PathLike[str],
    title: str,
    summary: str,
    sections: Sequence[Section],
    *,
    banner: Banner | None = None,
    files: Sequence[str] = (),
    made: Sequence[tuple[str, str]] = (),
) -> Path:
    """Write a report as one complete HTML file, or nothing.

    Parameters
    ----------
    path
        File to write. The function creates a missing folder.
    title
        Heading of the page.
    summary
        One line below it.
    sections
        Contents.
    banner
        Outcome, shown above the contents.
    files
        Names of the files that belong to the report.
    made
        Identity of the report (see `bywire.report.identity`).

    Raises
    ------
    FileError
        When the file cannot be written.
    """
    text = page_html(title, summary, sections, banner=banner, names=files, made=made)
    return write_bytes(path, text.encode("utf-8"))


def page_html(
    title: str,
    summary: str,
    sections: Sequence[Section],
    *,
    banner: Banner | None = None,
    names: Sequence[str] = (),
    made: Sequence[tuple[str, str]] = (),
) -> str:
    """Return a report as one HTML page; see :func:`write_page`."""
    numbered = _numbered(sections)
    style, script = _file("page.css"), bare(_file("zoom.js")) if numbered.has_figures else ""
    parts = [
        f'<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n{_policy(script)}\n'
        f"{listed(names)}"
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{_text(title)}</title>\n<style>\n{style}</style>\n</head>\n<body>",
        f'<header>\n<h1>{_text(title)}</h1>\n<p class="summary">{_text(summary)}</p>',
        _banner(banner) if banner is not None else "",
        _identity(made),
        _contents(sections) if len(sections) > 2 else "",
        "</header>\n<main>",
        *(_section(section, k, numbered) for k, section in enumerate(sections, 1)),
        f"</main>\n<footer>bywire {_text(__version__)}</footer>",
        f"<script>{script}</script>" if script else "",
        "</body>\n</html>\n",
    ]
    return "\n".join(part for part in parts if part)


def fragment_html(document: Document, notes: Sequence[str] = ()) -> str:
    """Return a document as an HTML fragment for a notebook: banner, warnings, sections."""
    numbered = _numbered(document.page)
    warnings = [Section("Warnings", [Listing(notes)])] if notes else []
    sections = [*warnings, *document.page]
    numbered.is_sortable = True
    parts = [
        f"<h3>{_text(document.title)}</h3>\n<p>{_text(document.summary)}</p>",
        _banner(document.banner) if document.banner is not None else "",
        *(_section(section, k, numbered) for k, section in enumerate(sections, 1)),
    ]
    if any("<table>" in part for part in parts):
        parts.append(f"<script>{_file('sort.js')}</script>")
    return '<div class="bywire">\n' + "\n".join(part for part in parts if part) + "\n</div>"


def _policy(script: str) -> str:
    """Return the policy by which the browser blocks other scripts and external content."""
    scripts = f"script-src {admitted(script)}; " if script else ""
    return (
        '<meta http-equiv="Content-Security-Policy" content="default-src \'none\'; '
        f"{scripts}style-src 'unsafe-inline'; img-src data:; base-uri 'none'; "
        "form-action 'none'\">"
    )


def _file(name: str) -> str:
    return files("bywire.report").joinpath(name).read_text(encoding="utf-8")


def _numbered(sections: Sequence[Section]) -> _Numbered:
    blocks = [block for section in sections for block in flat_blocks(section.blocks)]
    shown = [(b.figure, b.caption) for b in blocks if isinstance(b, FigureBlock)]
    is_zoomed = any(isinstance(b, FigureBlock | Drawing) for b in blocks)
    return _Numbered(inline_figures(shown), is_zoomed)


class _Numbered:
    """Figures in order, and the numbers of figures and tables."""

    def __init__(self, figures: Sequence[str], has_figures: bool) -> None:
        self.figures = iter(figures)
        self.has_figures = has_figures
        self.is_sortable = False
        self.figure_numbers = count(1)
        self.table_numbers = count(1)


def _text(text: str) -> str:
    return escape(clean(text), quote=True)


def _banner(banner: Banner) -> str:
    text = _MARKS[banner.verdict] + _text(banner.text)
    return f'<div class="status {banner.verdict}" role="status">{text}</div>'


def _identity(made: Sequence[tuple[str, str]]) -> str:
    rows = "".join(f"<dt>{_text(label)}</dt><dd>{_text(text)}</dd>" for label, text in made)
    return f'<dl class="identity">{rows}</dl>' if rows else ""


def _contents(sections: Sequence[Section]) -> str:
    links = "".join(
        f'<li><a href="#section-{k}">{_text(section.title)}</a></li>'
        for k, section in enumerate(sections, 1)
    )
    return f'<nav aria-label="Contents"><ul>{links}</ul></nav>'


def _section(section: Section, number: int, numbered: _Numbered) -> str:
    body = "\n".join(_block(block, numbered) for block in section.blocks)
    title = _text(section.title)
    return f'<section id="section-{number}">\n<h2>{title}</h2>\n{body}\n</section>'


def _block(block: Block, numbered: _Numbered) -> str:
    if isinstance(block, Paragraph):
        return f"<p>{_text(block.text)}</p>"
    if isinstance(block, Listing):
        entries = "\n".join(f"<li>{_text(text)}</li>" for text in block.texts)
        title = f"<p>{_text(block.title)}</p>\n" if block.title else ""
        return f"{title}<ul>\n{entries}\n</ul>"
    if isinstance(block, Details):
        body = "\n".join(_block(inner, numbered) for inner in block.blocks)
        return f"<details>\n<summary>{_text(block.title)}</summary>\n{body}\n</details>"
    if isinstance(block, FigureBlock):
        caption = f"Figure {next(numbered.figure_numbers)}. {_text(block.caption)}"
        return f"<figure>\n{next(numbered.figures)}\n<figcaption>{caption}</figcaption>\n</figure>"
    if isinstance(block, Drawing):
        caption = f"Figure {next(numbered.figure_numbers)}. {_text(block.caption)}"
        drawing = f"{block.source()}\n<figcaption>{caption}</figcaption>"
        return f'<figure class="wide">\n{drawing}\n</figure>'
    caption = ""
    if block.caption:
        number = next(numbered.table_numbers)
        caption = f"<figcaption>Table {number}. {_text(block.caption)}</figcaption>\n"
    table = table_html(block.table, is_sortable=numbered.is_sortable)
    return f"<figure>\n{caption}{table}\n</figure>"


_VERDICTS = ("verdict", "agrees", "result", "class")
_OF_MANY = ("result", "class")  # headings of verdicts on cases that many columns describe
_DETAILS = ("numerical error", "tolerance", "kind")


def _verdicts_first(table: Table) -> Table:
    """Return a table with limits and verdicts before details, so that a phone shows them."""
    headings = [column.heading for column in table.columns]
    verdict = next((k for k, heading in enumerate(headings) if heading in _VERDICTS), None)
    if verdict is None:
        return table
    first = [k for k in range(verdict) if headings[k] not in _DETAILS]
    if headings[verdict] in _OF_MANY:
        first = first[:1]
    order = [*first, verdict, *(k for k in range(len(headings)) if k not in {*first, verdict})]
    return Table(
        tuple(table.columns[k] for k in order),
        tuple(tuple(row[k] for k in order) for row in table.rows),
    )


def table_html(table: Table, *, is_sortable: bool = False) -> str:
    """Return a table as HTML; every text in it is escaped.

    Cells of a sortable table contain their numbers in an attribute, in one unit.
    """
    table = _verdicts_first(table)
    heading = "".join(
        f'<th scope="col"{_number_class(column)}>{escape(column.heading)}</th>'
        for column in table.columns
    )
    body = "\n".join(
        "<tr>"
        + "".join(
            _table_cell(cell, column, is_sortable, is_first=k == 0)
            for k, (cell, column) in enumerate(zip(row, table.columns, strict=True))
        )
        + "</tr>"
        for row in table.rows
    )
    wide = " wide" if len(table.columns) >= _MANY else ""
    return (
        f'<div class="scroll{wide}"><table>\n<thead><tr>{heading}</tr></thead>\n'
        f"<tbody>\n{body}\n</tbody>\n</table></div>"
    )


def _table_cell(cell: Cell, column: Column, is_sortable: bool, *, is_first: bool) -> str:
    number = cell.value if is_sortable else None
    data = "" if number is None else f' data-value="{number}"'
    text = escape(_MARKS[cell.verdict] + cell.text).replace("\n", "<br>")
    if is_first and "-" in cell.text and len(cell.text) <= _SHORT:
        text = f'<span class="name">{text}</span>'
    elif is_first:  # on a phone, a long name must leave room for the verdict
        text = text.replace("_", "_<wbr>")
    if cell.link:
        text = f'<a href="{escape(quote(cell.link))}">{text}</a>'
    if cell.verdict != "none":
        return f'<td class="{cell.verdict}{" number" * column.numeric}"{data}>{text}</td>'
    return f"<td{_number_class(column)}{data}>{text}</td>"


def _number_class(column: Column) -> str:
    return ' class="number"' if column.numeric else ""
