"""What drives the key figures of a study by indices: tables, figure, JSON, and what is missing."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict
from functools import partial
from typing import TYPE_CHECKING, Any

from bywire.api.study_tables import figure_text, shown_figures, strongest
from bywire.report.document import FigureBlock, TableBlock
from bywire.report.tables import Cell, Column, Table
from bywire.report.wording import clean
from bywire.studies.findings import ChoiceInfluence, Effect, Findings
from bywire.studies.sensitivity import ElementaryEffects, Estimate, VarianceShares

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_CAPTIONS = {
    "sobol-indices": "Shares of the variance of each key figure that a quantity makes, alone and "
    "with all others, with their intervals. Pale: not distinct from none.",
    "morris": "Mean size (with its interval) and standard deviation of the elementary effects of "
    "each quantity. Pale: not distinct from none.",
}


def sensitivity_tables(findings: Findings) -> list[TableBlock]:
    """Return the indices of each key figure of a requirement; of all where nothing is required."""
    return [
        TableBlock(
            _table(findings, name, found), f"What drives {name}.", title=f"what drives {name}"
        )
        for name in shown_figures(findings)
        if (found := findings.sensitivity(name).drivers)
    ]


def sensitivity_figures(findings: Findings) -> list[FigureBlock]:
    """Return the figure of all indices; none where there are none."""
    drivers = [findings.sensitivity(name).drivers for name in shown_figures(findings)]
    if not any(drivers):
        return []
    caption = _CAPTIONS[findings.plan.design] + strongest(drivers)
    return [FigureBlock(partial(_bars, findings), caption, "sensitivity")]


def drivers_data(findings: Findings, name: str) -> dict[str, Any]:
    """Return what drives a key figure for JSON: influences, effects, or indices.

    Figures and effects are in the unit of the figure, values of quantities in SI.
    """
    if findings.plan.sensitivity is None and not findings.plan.is_sampled:
        found = findings.effects(name)
        return {"effects": {e.quantity: _effect_data(e) for e in found}} if found else {}
    if findings.plan.sensitivity is None:
        return {
            "influences": {
                i.quantity: {"correlation_ratio": i.correlation_ratio, "distinct": i.is_distinct}
                if isinstance(i, ChoiceInfluence)
                else {"correlation": i.correlation, "low": i.low, "high": i.high}
                for i in findings.influences(name)
            }
        }
    if name not in shown_figures(findings):
        return {}
    indices = findings.sensitivity(name)
    drivers = [asdict(each) for each in indices.drivers]
    data: dict[str, Any] = {"sensitivity": {each.pop("quantity"): each for each in drivers}}
    return data | ({"sensitivity_missing": indices.missing} if indices.missing else {})


def _effect_data(effect: Effect) -> dict[str, Any]:
    return {
        "unit": effect.unit or None,
        "values": list(effect.values),
        "figures": effect.figures.tolist(),
        "swing": effect.swing,
        "undefined": effect.lacking,
    }


def missing_indices(findings: Findings) -> list[str]:
    """Return in a sentence which key figures have no indices, and why; nothing where all have.

    Nothing, too, of designs that are not made for indices.
    """
    if findings.plan.sensitivity is None:
        return []
    reasons: dict[str, list[str]] = {}
    for name in shown_figures(findings):
        if reason := findings.sensitivity(name).missing:
            reasons.setdefault(reason, []).append(name)
    said = [f"of {', '.join(names)}: {reason}" for reason, names in reasons.items()]
    return [f"no indices {'; '.join(said)}"] if said else []


def _table(
    findings: Findings,
    name: str,
    drivers: Sequence[VarianceShares] | Sequence[ElementaryEffects],
) -> Table:
    columns, rows = [Column("quantity")], []
    written = partial(figure_text, findings, name, digits=3, is_difference=True)
    for each in drivers:
        if isinstance(each, VarianceShares):
            heads = ["first order", "interval", "total", "interval"]
            cells = [*_cells(each.first, _share), *_cells(each.total, _share)]
        else:
            heads = ["mu*", "interval", "sigma"]
            cells = [*_cells(each.mu_star, written), Cell(written(each.sigma))]
        rows.append((Cell(clean(each.quantity)), *cells))
    columns += [Column(head, numeric=head != "interval") for head in heads]
    return Table(tuple(columns), tuple(rows))


def _cells(of: Estimate, written: Callable[[float], str]) -> list[Cell]:
    """Return estimate and interval."""
    value, low, high = map(written, (of.value, of.low, of.high))
    return [Cell(value, value=of.value), Cell(f"{low} to {high}")]


def _share(value: float) -> str:
    return f"{round(value, 2) + 0.0:.2f}"  # no -0.00


def _bars(findings: Findings) -> Figure:
    from bywire.report.study.influences import sensitivity_bars

    each = {name: findings.sensitivity(name).drivers for name in shown_figures(findings)}
    each = {name: found for name, found in each.items() if found}
    return sensitivity_bars(each, findings.units, {name: findings.size(name) for name in each})
