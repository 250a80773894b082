"""Tables of KPIs, of reproduced statements and of parameters, for all outputs."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Literal

from bywire.bench.requirements import COMPARE
from bywire.core.units import difference_unit
from bywire.report.wording import (
    amount,
    beside_limit,
    clean,
    error_text,
    measured_amount,
    unit_text,
)

Verdict = Literal["good", "bad", "open", "none"]


@dataclass(frozen=True)
class Cell:
    """Text of a cell, with its verdict (good, bad or open) and its value.

    Parameters
    ----------
    value
        Number, or another value for a data table. Default: the text.
    unit
        Unit of a number, SI unless the text has another unit; ``"1"`` for a pure number.
    link
        Path of another page, relative to the page of the table; empty for none.
    """

    text: str
    verdict: Verdict = "none"
    value: object = None
    unit: str = ""
    link: str = ""

    @property
    def content(self) -> object:
        """Value for a table of data."""
        return self.text if self.value is None else self.value


def amount_cell(value: float | None, unit: str, digits: int = 4) -> Cell:
    """Return the cell of a number in an SI unit; NaN for none."""
    return Cell(amount(value, unit, digits), value=math.nan if value is None else value, unit=unit)


def measured_cell(
    value: float | None, unit: str, error: float, digits: int = 4, like: float | None = None
) -> Cell:
    """Return the cell of a number with the significant digits of its error; see `amount_cell`."""
    text = measured_amount(value, unit, error, digits, like)
    return Cell(text, value=math.nan if value is None else value, unit=unit)


@dataclass(frozen=True)
class Column:
    """Heading of a column.

    Parameters
    ----------
    numeric
        Whether it is aligned to the right.
    is_detail
        Whether a terminal shows it only with ``--verbose``.
    """

    heading: str
    numeric: bool = False
    is_detail: bool = False


@dataclass(frozen=True)
class Table:
    """Columns and rows of equal length."""

    columns: tuple[Column, ...]
    rows: tuple[tuple[Cell, ...], ...]

    @property
    def brief(self) -> Table:
        """The same table without detail columns."""
        kept = [k for k, column in enumerate(self.columns) if not column.is_detail]
        return Table(
            tuple(self.columns[k] for k in kept),
            tuple(tuple(row[k] for k in kept) for row in self.rows),
        )


@dataclass(frozen=True)
class KpiRow:
    """A key figure.

    Parameters
    ----------
    name, value, unit
        Its name, its value in ``unit`` (``None`` for none) and the unit.
    definition
        Definition of the figure.
    limit
        The requirement as text, for example ``"<= 15 %"``; empty for none.
    outcome
        ``met``, ``missed`` or ``undecided``; empty without a requirement.
    error
        Numerical error, in ``unit``; NaN if it was not estimated.
    stated, where
        Value stated by a source, as text, and the place there; empty for none.
    converges
        Whether runs with several steps converge. Otherwise ``error`` is only a bound.
    """

    name: str
    value: float | None
    unit: str
    definition: str = ""
    limit: str = ""
    outcome: str = ""
    error: float = math.nan
    stated: str = ""
    where: str = ""
    converges: bool = True


@dataclass(frozen=True)
class ReproductionRow:
    """A statement of a source, and our computed value.

    Parameters
    ----------
    id
        Name of the statement.
    stated, computed
        Values in ``unit``; ``None`` where nothing is stated or computed.
    unit
        Unit.
    tolerance
        Text, or a number in ``unit``; ``None`` for none; ``"<="`` or ``">="`` for a bound, which is
        then shown before it.
    agrees
        ``None`` if it cannot be judged.
    note
        Note for the reader.
    kind
        Kind of the statement, for example ``"requirement"``.
    """

    id: str
    stated: float | None
    computed: float | None
    unit: str
    tolerance: float | str | None = None
    agrees: bool | None = None
    note: str = ""
    kind: str = ""

    @property
    def bound(self) -> str:
        """``"<="`` or ``">="`` where the statement is a bound, else empty."""
        return str(self.tolerance) if self.tolerance in COMPARE else ""


@dataclass(frozen=True)
class ParameterRow:
    """A parameter with its provenance.

    Parameters
    ----------
    name, value, unit
        Dotted name, value in the SI ``unit``; the value may also be a choice or a table.
    range
        Valid range as text.
    kind
        Provenance, for example ``"paper"`` or ``"chosen"``.
    where
        Place in the source, or the reason.
    """

    name: str
    value: object
    unit: str = "1"
    range: str = ""
    kind: str = ""
    where: str = ""


def kpi_table(rows: Iterable[KpiRow]) -> Table:
    """Return the table of key figures, with columns of limits, errors and statements if needed.

    Each value has the significant digits that its error allows.
    """
    listed = list(rows)
    limited = any(row.limit for row in listed)
    estimated = any(not math.isnan(row.error) for row in listed)
    stated, placed = any(row.stated for row in listed), any(row.where for row in listed)
    columns = [Column("name"), Column("value", numeric=True)]
    columns += [Column("numerical error", numeric=True)] * estimated
    columns += [Column("limit", numeric=True), Column("verdict")] * limited
    columns += [Column("stated", numeric=True)] * stated
    columns += [Column("stated in", is_detail=True)] * placed
    return Table(
        (*columns, Column("definition", is_detail=True)),
        tuple(
            (
                Cell(clean(row.name)),
                _value_cell(row),
                *((_error_cell(row),) * estimated),
                *((Cell(clean(row.limit) or "-"), OUTCOMES[row.outcome]) * limited),
                *((Cell(clean(row.stated) or "-"),) * stated),
                *((Cell(clean(row.where) or "-"),) * placed),
                Cell(clean(row.definition)),
            )
            for row in listed
        ),
    )


def _value_cell(row: KpiRow) -> Cell:
    value, error, unit = beside_limit(row.value, row.error, row.unit, row.limit)
    text = measured_amount(value, unit, error)
    return Cell(text, value=math.nan if row.value is None else row.value, unit=row.unit)


def _error_cell(row: KpiRow) -> Cell:
    value, error, unit = beside_limit(row.value, row.error, row.unit, row.limit)
    text = error_text(value, unit, error, row.converges)
    return Cell(text, value=row.error, unit=row.unit)


def reproduction_table(rows: Iterable[ReproductionRow]) -> Table:
    """Return the table of a source's statements and our computed values."""
    return Table(
        (
            Column("statement"),
            Column("kind"),
            Column("stated", numeric=True),
            Column("computed", numeric=True),
            Column("tolerance", numeric=True),
            Column("agrees"),
            Column("note"),
        ),
        tuple(
            (
                Cell(clean(row.id)),
                Cell(clean(row.kind)),
                Cell(_stated(row)),
                amount_cell(row.computed, row.unit),
                Cell(_tolerance(row)),
                _judged(row.agrees, "yes", "no"),
                Cell(clean(row.note)),
            )
            for row in rows
        ),
    )


def verdict_table(rows: Iterable[ReproductionRow]) -> Table:
    """Return the table without tolerances and notes, which is narrow enough for a terminal."""
    return Table(
        (
            Column("statement"),
            Column("kind"),
            Column("stated", numeric=True),
            Column("computed", numeric=True),
            Column("verdict"),
        ),
        tuple(
            (
                Cell(clean(row.id)),
                Cell(clean(row.kind)),
                Cell(_stated(row)),
                amount_cell(row.computed, row.unit),
                _judged(row.agrees, "agrees", "disagrees"),
            )
            for row in rows
        ),
    )


def parameter_table(rows: Iterable[ParameterRow]) -> Table:
    """Return the table of parameters in their display units, with range and provenance."""
    return Table(
        (
            Column("parameter"),
            Column("value", numeric=True),
            Column("range"),
            Column("provenance"),
            Column("where"),
        ),
        tuple(
            (
                Cell(clean(row.name)),
                Cell(value_text(row.value, row.unit)),
                Cell(clean(row.range)),
                Cell(clean(row.kind)),
                Cell(clean(row.where)),
            )
            for row in rows
        ),
    )


def text_table(heading: Sequence[str], rows: Iterable[Sequence[object]]) -> Table:
    """Return a table of plain texts and finished cells."""
    cells = (
        (each if isinstance(each, Cell) else Cell(clean(each)) for each in row) for row in rows
    )
    return Table(tuple(Column(clean(name)) for name in heading), tuple(map(tuple, cells)))


OUTCOMES: dict[str, Cell] = {
    "": Cell("-"),
    "met": Cell("met", "good"),
    "missed": Cell("missed", "bad"),
    "undecided": Cell("undecided", "open"),
    "not shown": Cell("not shown", "open"),
}
"""texts of a requirement's verdict in tables"""


def _judged(holds: bool | None, good: str, bad: str) -> Cell:
    if holds is None:
        return Cell("-")
    return Cell(good, "good") if holds else Cell(bad, "bad")


def _stated(row: ReproductionRow) -> str:
    written = amount(row.stated, row.unit)
    return f"{row.bound} {written}" if row.bound and row.stated is not None else written


def _tolerance(row: ReproductionRow) -> str:
    if row.bound:
        return "-"
    if isinstance(row.tolerance, str):
        return clean(row.tolerance) or "-"
    return amount(row.tolerance, difference_unit(row.unit))


def value_text(value: object, unit: str) -> str:
    """Return a parameter's value; a choice unchanged, a table number by number."""
    if value is None or isinstance(value, (bool, str)):
        return "-" if value is None else clean(value)
    if isinstance(value, (int, float)):
        return amount(float(value), unit, 6)
    if isinstance(value, Sequence):
        return ", ".join(value_text(item, unit) for item in value) or "empty"
    written = unit_text(unit)
    return clean(value) + (f" {written}" if written else "")
