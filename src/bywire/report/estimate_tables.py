"""Tables of an identification: parameters with their intervals, what is not told, checks."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from bywire.identification.estimate import Estimate
from bywire.identification.method import Check, Identified
from bywire.identification.trust import Trust
from bywire.report.tables import Cell, Column, Table
from bywire.report.wording import amount, clean, in_display_unit, unit_text


def estimate_table(estimate: Estimate, before: Mapping[str, float] | None = None) -> Table:
    """Return the estimates with the half widths of their 95 % intervals, in display units.

    Parameters
    ----------
    estimate
        What was found; what the data does not tell stands below it.
    before
        Values that the parameter set had, by label.
    """
    rows = []
    for unknown, value, (low, high) in zip(
        estimate.unknowns, estimate.values, estimate.intervals(), strict=True
    ):
        shown, half, unit = with_interval(float(value), 0.5 * float(high - low), unknown.unit)
        share = _percent(50.0 * float(high - low) / abs(value)) if value else "-"
        rows.append(
            (Cell(clean(unknown.label)), Cell(shown), Cell(half), Cell(share), Cell(unit),
             Cell(_old(before, unknown.label, unknown.unit)))
        )  # fmt: skip
    for kept in estimate.kept:
        u = kept.unknown
        shown, _, unit = with_interval(u.start, 0.0, u.unit)
        rows.append(
            (Cell(clean(u.label)), Cell(shown), Cell("not told", "bad"), Cell("-"), Cell(unit),
             Cell(_old(before, u.label, u.unit)))
        )  # fmt: skip
    columns = (
        Column("parameter"), Column("estimate", numeric=True), Column("± (95 %)", numeric=True),
        Column("share", numeric=True), Column("unit"), Column("before", numeric=True),
    )  # fmt: skip
    keep = 6 if any(row[5].text != "-" for row in rows) else 5
    return Table(columns[:keep], tuple(row[:keep] for row in rows))


def with_interval(value: float, half: float, symbol: str) -> tuple[str, str, str]:
    """Return value, half width of its interval and unit as texts, to two digits of the latter."""
    number, unit = in_display_unit(value, symbol)
    reach = abs(in_display_unit(half, symbol)[0])
    digits = 6
    if reach > 0.0 and number != 0.0:
        digits = min(max(math.floor(math.log10(abs(number)) - math.log10(reach)) + 2, 2), 9)
    return f"{number:.{digits}g}", f"{reach:.2g}", unit_text(unit) or "-"


def _percent(share: float) -> str:
    """Return an uncertainty in percent; a thousand of them say no more than many."""
    if share >= 1000.0:
        return "> 1000 %"
    return f"{share:.0f} %" if share >= 10.0 else f"{share:.2g} %"


def _old(before: Mapping[str, float] | None, label: str, symbol: str) -> str:
    if before is None or label not in before:
        return "-"
    return f"{in_display_unit(before[label], symbol)[0]:.5g}"


def check_table(checks: Sequence[Check]) -> Table:
    """Return the checks with their limits."""
    rows = []
    for one in checks:
        sign = ">=" if one.at_least else "<="
        limit = "-" if one.limit is None else f"{sign} {amount(one.limit, one.unit)}"
        verdict = Cell("-")
        if one.limit is not None:
            verdict = Cell("ok", "good") if one.holds else Cell("failed", "bad")
        rows.append(
            (Cell(clean(one.name)), Cell(amount(one.value, one.unit)), Cell(limit), verdict,
             Cell(clean(one.note)))
        )  # fmt: skip
    return Table(
        (Column("check"), Column("value", numeric=True), Column("limit", numeric=True),
         Column("result"), Column("meaning")),
        tuple(rows),
    )  # fmt: skip


def figure_table(found: Identified) -> Table:
    """Return a method's further results."""
    return Table(
        (Column("result"), Column("value", numeric=True)),
        tuple(
            (Cell(clean(name)), Cell(amount(value, unit, 5)))
            for name, (value, unit) in found.figures.items()
        ),
    )


def trust_table(found: Trust) -> Table:
    """Return how well what was put in comes back."""
    rows = []
    for one in found.recovered:
        low, high = one.coverage_range
        ratio = one.claimed / one.scatter if one.scatter > 0.0 else float("nan")
        rows.append(
            (Cell(clean(one.label)), Cell(amount(one.truth, one.unit)), Cell(str(one.count)),
             Cell(f"{one.bias_in_errors:+.2f}"),
             Cell(f"{100 * one.coverage:.1f} % ({100 * low:.0f} to {100 * high:.0f} %)"),
             Cell(f"{ratio:.2f}"),
             Cell("ok", "good") if one.holds else Cell("failed", "bad"))
        )  # fmt: skip
    return Table(
        (Column("parameter"), Column("put in", numeric=True), Column("count", numeric=True),
         Column("bias / standard error", numeric=True), Column("intervals that hold it"),
         Column("claimed / real scatter", numeric=True), Column("result")),
        tuple(rows),
    )  # fmt: skip
