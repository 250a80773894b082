"""A table as HTML; every text in it is escaped."""

from __future__ import annotations

from html import escape

from bywire.report.tables import Cell, Column, Table

_MARKS = {"good": "✓ ", "bad": "✗ ", "none": ""}


def table_html(table: Table) -> str:
    """Return a table as HTML."""
    heading = "".join(
        f'<th scope="col"{_number_class(column)}>{escape(column.heading)}</th>'
        for column in table.columns
    )
    body = "\n".join(
        "<tr>"
        + "".join(_cell(c, column) for c, column in zip(row, table.columns, strict=True))
        + "</tr>"
        for row in table.rows
    )
    return (
        f'<div class="scroll"><table>\n<thead><tr>{heading}</tr></thead>\n'
        f"<tbody>\n{body}\n</tbody>\n</table></div>"
    )


def _cell(cell: Cell, column: Column) -> str:
    text = escape(_MARKS[cell.verdict] + cell.text).replace("\n", "<br>")
    if cell.verdict != "none":
        return f'<td class="{cell.verdict}">{text}</td>'
    return f"<td{_number_class(column)}>{text}</td>"


def _number_class(column: Column) -> str:
    return ' class="number"' if column.numeric else ""
