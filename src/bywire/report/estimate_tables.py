"""Tables of an identification: parameters with their intervals, undetermined unknowns, checks."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from bywire.core.units import display_factor
from bywire.identification.estimate import Estimate
from bywire.identification.method import Check, Identified
from bywire.identification.trust import Trust
from bywire.identification.unknown import Unknown
from bywire.report.tables import Cell, Column, Table, amount_cell
from bywire.report.wording import amount, clean, in_display_unit, unit_text


def estimate_table(
    estimate: Estimate,
    start: Mapping[str, float] | None = None,
    put_in: Mapping[str, float] | None = None,
) -> Table:
    """Return the estimates with the half widths of their 95 % intervals, in display units.

    Parameters
    ----------
    estimate
        Estimates. Unknowns that the data do not determine follow below them. If the model is
        simulated, a column contains the error from the simulation step.
    start
        Initial values of the search, by label.
    put_in
        True values of a simulated measurement, by label.
    """
    beside: dict[str, Mapping[str, float]] = {"true value": put_in or {}, "start": start or {}}
    beside = {
        title: known
        for title, known in beside.items()
        if any(u.label in known for u in estimate.all_unknowns)
    }
    rows = []
    steps = estimate.step_errors
    unknown_errors = [math.nan] * len(estimate.unknowns)
    for unknown, value, (low, high), error in zip(
        estimate.unknowns,
        estimate.values,
        estimate.intervals(),
        unknown_errors if steps is None else steps,
        strict=True,
    ):
        number, half, unit = with_interval(float(value), 0.5 * float(high - low), unknown.unit)
        share = _percent(50.0 * float(high - low) / abs(value)) if value else "-"
        shown = in_display_unit(float(value), unknown.unit)[0]
        reach = display_factor(unknown.unit) * 0.5 * float(high - low)
        off = display_factor(unknown.unit) * abs(float(error))
        by_step = [] if steps is None else [Cell(f"{off:.1g}", value=off)]
        rows.append(
            (
                unknown,
                [
                    Cell(number, value=shown),
                    Cell(half, value=reach),
                    *by_step,
                    Cell(share),
                    Cell(unit),
                ],
            )
        )
    for u in (kept.unknown for kept in estimate.kept):
        number, _, unit = with_interval(u.start, 0.0, u.unit)
        by_step = [] if steps is None else [Cell("-")]
        undetermined = Cell("not determined", "bad")
        rows.append((u, [Cell(number), undetermined, *by_step, Cell("-"), Cell(unit)]))
    return Table(
        (
            Column("parameter"),
            Column("estimate", numeric=True),
            Column("± (95 %)", numeric=True),
            *([] if steps is None else [Column("step error", numeric=True)]),
            Column("relative uncertainty", numeric=True),
            Column("unit"),
            *(Column(title, numeric=True) for title in beside),
        ),
        tuple(
            (Cell(clean(u.label)), *cells, *(_known(known, u) for known in beside.values()))
            for u, cells in rows
        ),
    )


def with_interval(value: float, half: float, symbol: str) -> tuple[str, str, str]:
    """Return value, half width of its interval and unit as texts, to two digits of the width."""
    number, unit = in_display_unit(value, symbol)
    reach = display_factor(symbol) * abs(half)
    digits = 6
    if reach > 0.0 and number != 0.0:
        digits = min(max(math.floor(math.log10(abs(number)) - math.log10(reach)) + 2, 2), 9)
    return f"{number:.{digits}g}", f"{reach:.2g}", unit_text(unit) or "-"


def _percent(share: float) -> str:
    """Return an uncertainty in percent, capped at 1000 %."""
    if share >= 1000.0:
        return "> 1000 %"
    return f"{share:.0f} %" if share >= 10.0 else f"{share:.2g} %"


def _known(values: Mapping[str, float], unknown: Unknown) -> Cell:
    if unknown.label not in values:
        return Cell("-")
    return Cell(f"{in_display_unit(values[unknown.label], unknown.unit)[0]:.5g}")


def check_table(checks: Sequence[Check]) -> Table:
    """Return the checks with their limits."""
    rows = []
    for check in checks:
        sign = ">=" if check.at_least else "<="
        limit = "-" if check.limit is None else f"{sign} {amount(check.limit, check.unit)}"
        verdict = Cell("-")
        if check.limit is not None:
            verdict = Cell("ok", "good") if check.holds else Cell("failed", "bad")
        rows.append(
            (
                Cell(clean(check.name)),
                amount_cell(check.value, check.unit),
                Cell(limit),
                verdict,
                Cell(clean(check.note)),
            )
        )
    return Table(
        (
            Column("check"),
            Column("value", numeric=True),
            Column("limit", numeric=True),
            Column("result"),
            Column("meaning"),
        ),
        tuple(rows),
    )


def figure_table(identified: Identified) -> Table:
    """Return a method's other results."""
    return Table(
        (Column("result"), Column("value", numeric=True)),
        tuple(
            (Cell(clean(name)), amount_cell(value, unit, 5))
            for name, (value, unit) in identified.figures.items()
        ),
    )


def trust_table(trust: Trust) -> Table:
    """Return a table that compares the estimates with the true values."""
    rows = []
    for recovered in trust.recovered:
        low, high = recovered.coverage_range
        ratio = recovered.claimed / recovered.scatter if recovered.scatter > 0.0 else float("nan")
        rows.append(
            (
                Cell(clean(recovered.label)),
                amount_cell(recovered.truth, recovered.unit),
                Cell(str(recovered.count)),
                Cell(f"{recovered.bias_in_errors:+.2f}"),
                Cell(f"{100 * recovered.coverage:.1f} % ({100 * low:.0f} to {100 * high:.0f} %)"),
                Cell(f"{ratio:.2f}"),
                Cell("ok", "good") if recovered.holds else Cell("failed", "bad"),
            )
        )
    return Table(
        (
            Column("parameter"),
            Column("true value", numeric=True),
            Column("count", numeric=True),
            Column("bias / standard error", numeric=True),
            Column("intervals with the true value"),
            Column("estimated / actual scatter", numeric=True),
            Column("result"),
        ),
        tuple(rows),
    )
