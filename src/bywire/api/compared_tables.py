"""What differs between runs, setting by setting and figure by figure, and the tables of it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from bywire.api.compared_run import ComparedRun, Setting
from bywire.bench.step_error import are_distinct
from bywire.core.units import difference_unit
from bywire.report.tables import Cell, Column, Table, measured_cell, value_text
from bywire.report.wording import clean, measured_amount

_LONGEST = 48  # characters of a value in a table


@dataclass(frozen=True)
class Compared:
    """One setting or key figure of all runs.

    Parameters
    ----------
    name, unit
        What it is called, and its SI unit or ``"%"``.
    values
        Its value in each run; None where a run has no such thing, NaN where it is not defined.
    errors
        How far each value of a key figure may be off by the step, NaN where that was not estimated.
    """

    name: str
    unit: str
    values: tuple[Any, ...]
    errors: tuple[float, ...] = ()

    @property
    def differs(self) -> bool:
        """Whether not all runs have the same value; what is not defined equals itself."""
        first, *others = (_comparable(value) for value in self.values)
        return any(value != first for value in others)

    @property
    def is_distinct(self) -> bool:
        """Whether a key figure differs by more than its errors; they count as independent."""
        values = [math.nan if value is None else value for value in self.values]
        return are_distinct(values, self.errors)


def compared_settings(runs: Sequence[ComparedRun], *, shared_only: bool) -> tuple[Compared, ...]:
    """Return everything that was set, or what all runs have of it."""
    names = list(dict.fromkeys(name for each in runs for name in each.settings))
    if shared_only:
        names = [name for name in names if all(name in each.settings for each in runs)]
    rows = []
    for name in names:
        present = [each.settings.get(name) for each in runs]
        unit = next(each.unit for each in present if each is not None)
        rows.append(Compared(name, unit, tuple(_value(each) for each in present)))
    return tuple(rows)


def compared_figures(runs: Sequence[ComparedRun]) -> tuple[Compared, ...]:
    """Return every key figure that some run has; those of another unit stay apart."""
    keys = dict.fromkeys((kpi.name, kpi.unit) for each in runs for kpi in each.kpis)
    each_run = [{(k.name, k.unit): (k.value, k.bound) for k in each.kpis} for each in runs]
    rows = []
    for name, unit in keys:
        pairs = [known.get((name, unit), (None, math.nan)) for known in each_run]
        rows.append(Compared(name, unit, tuple(v for v, _ in pairs), tuple(e for _, e in pairs)))
    return tuple(rows)


def settings_table(labels: Sequence[str], rows: Sequence[Compared]) -> Table:
    """Return settings of all runs, a column each."""
    return Table(
        (Column("setting"), *(Column(label, numeric=True) for label in labels)),
        tuple(
            (Cell(clean(each.name)), *(_setting(v, each.unit) for v in each.values))
            for each in rows
        ),
    )


def kpi_table(labels: Sequence[str], rows: Sequence[Compared]) -> Table:
    """Return key figures of all runs, a column each, and their change; of many, the spread."""
    change = "change" if len(labels) == 2 else "spread"
    return Table(
        (
            Column("name"),
            *(Column(label, numeric=True) for label in labels),
            Column(change, numeric=True),
        ),
        tuple(
            (
                Cell(clean(each.name)),
                *(
                    measured_cell(v, each.unit, e)
                    for v, e in zip(each.values, each.errors, strict=True)
                ),
                _change(each),
            )
            for each in rows
        ),
    )


def verdict_table(runs: Sequence[ComparedRun]) -> Table:
    """Return the requirements of all runs, one row each, with what every run makes of it."""
    each_run = [{(v.kpi, v.limit): v for v in each.verdicts} for each in runs]
    keys = dict.fromkeys(key for verdicts in each_run for key in verdicts)
    rows = []
    for name, limit in keys:
        cells = []
        for verdicts in each_run:
            verdict = verdicts.get((name, limit))
            if verdict is None:
                cells.append(Cell("-"))
                continue
            shown = measured_amount(verdict.value, verdict.unit, verdict.error)
            text = f"{shown} {verdict.outcome}"
            cells.append(Cell(text, "good" if verdict.met else "bad", verdict.outcome))
        rows.append((Cell(clean(name)), Cell(clean(limit)), *cells))
    columns = (Column("requirement"), Column("limit", numeric=True))
    return Table((*columns, *(Column(each.label, numeric=True) for each in runs)), tuple(rows))


def _change(row: Compared) -> Cell:
    """Return how far two values are apart, or several at most; or that they need not be."""
    known = [value for value in row.values if value is not None and math.isfinite(value)]
    if len(known) < len(row.values):
        return Cell("-")
    is_pair = len(known) == 2
    low, high = (0, 1) if is_pair else (known.index(min(known)), known.index(max(known)))
    first, change = known[low], known[high] - known[low]
    if not row.is_distinct:
        return Cell("not distinct", value=change)
    error = row.errors[low] + row.errors[high]
    written = measured_amount(change, difference_unit(row.unit), error, 3)
    is_share = is_pair and first and row.unit not in ("%", "K")
    share = f" ({100 * change / abs(first):+.3g} %)" if is_share else ""
    sign = "+" if is_pair and change > 0 else ""
    return Cell(f"{sign}{written}{share}", value=change)


def _setting(value: Any, unit: str) -> Cell:
    text = value_text(value, unit)
    return Cell(text if len(text) <= _LONGEST else text[: _LONGEST - 1] + "…", value=value)


def _value(setting: Setting | None) -> Any:
    return None if setting is None else setting.value


def _comparable(value: Any) -> Any:
    """Return what compares equal where two values are the same; NaN does not by itself."""
    return "NaN" if isinstance(value, float) and math.isnan(value) else value
