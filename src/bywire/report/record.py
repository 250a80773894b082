"""Rows of a result, each quantity stated once: tables, JSON and frames follow from it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from bywire.report.tables import Cell, Column, Table, amount_cell
from bywire.report.wording import clean

R = TypeVar("R")


@dataclass(frozen=True)
class Quantity(Generic[R]):
    """A quantity of every row.

    Parameters
    ----------
    value
        What it is of a row: what JSON holds.
    key
        Its name in JSON; empty where that does not have it.
    heading
        Of its column; empty where tables do not show it.
    unit
        SI unit of a number, ``"1"`` of a pure one; empty of anything else.
    text
        How a row shows it; by default a number with its unit, or the text itself.
    number
        What frames hold where that is neither the value nor the text, in the same unit.
    """

    value: Callable[[R], Any]
    key: str = ""
    heading: str = ""
    unit: str = ""
    text: Callable[[R], str] | None = None
    number: Callable[[R], float] | None = None

    def cell(self, row: R) -> Cell:
        """Return the cell of a row."""
        if not self.unit:
            text = str(self.value(row) or "") if self.text is None else self.text(row)
            return Cell(clean(text) or "-")
        number = (self.number or self.value)(row)
        if self.text is None:
            return amount_cell(number, self.unit)
        return Cell(clean(self.text(row)), "none", number, self.unit)


def record_table(rows: Iterable[R], columns: Sequence[Quantity[R]]) -> Table:
    """Return the table of rows, with the columns of those quantities that have a heading."""
    shown = [each for each in columns if each.heading]
    cells = tuple(tuple(each.cell(row) for each in shown) for row in rows)
    return Table(tuple(Column(each.heading) for each in shown), cells)


def record_data(row: R, quantities: Iterable[Quantity[R]]) -> dict[str, Any]:
    """Return the JSON object of a row."""
    return {each.key: each.value(row) for each in quantities if each.key}
