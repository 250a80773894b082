"""The tables of a study: requirements, key figures, what varies, and what drives them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from bywire.core.units import difference_unit
from bywire.report.document import Listing, TableBlock
from bywire.report.study.drawn_cases import BARS
from bywire.report.tables import OUTCOMES, Cell, Column, Table, text_table, value_text
from bywire.report.wording import amount, clean
from bywire.studies.designs import WORST
from bywire.studies.findings import ONE, ChoiceInfluence, Effect, Findings, Judgment
from bywire.studies.plan import StudyPlan
from bywire.studies.statistics import Influence, Share

_URGENCY = ("missed", "undecided", "met")  # outcomes, in the order in which they matter
_SHOWN = 5  # quantities that drive a key figure


def demand_table(findings: Findings) -> Table:
    """Return the requirements: how often they are met, how probable that is, and the verdict."""
    confidence = f"{100.0 * findings.plan.confidence:g} %"
    is_sampled = findings.plan.is_sampled
    is_search = findings.plan.design == WORST  # how many of its cases it went through says nothing
    counted = "worst found" if is_search else "cases that meet it"
    columns = [Column("requirement"), Column(counted, numeric=True)]
    columns += [Column("probability", numeric=True), Column(f"{confidence} interval")] * is_sampled
    rows = []
    for each in findings.judgments:
        count = f"{each.share.count} of {each.share.cases}"
        count += f" ({each.undecided} too close)" if each.undecided else ""
        cells = [Cell(clean(str(each.demand))), Cell(count, value=each.share.count)]
        if is_search:
            cells[1] = _worst(findings, each)
        if is_sampled:
            cells += [
                Cell(percent(each.share.value, each.share), value=each.share.value),
                Cell(
                    f"{percent(each.share.low, each.share)} to "
                    f"{percent(each.share.high, each.share)}"
                ),
            ]
        result = OUTCOMES[each.outcome]
        if each.outcome == "met" and each.demand.probability is None:
            result = replace(result, text="met in all")
        rows.append((*cells, result))
    return Table((*columns, Column("result")), tuple(rows))


def _worst(findings: Findings, judgment: Judgment) -> Cell:
    """Return the worst figure that was found; of cases that are all equal, theirs."""
    kpi = judgment.demand.figure
    figures = findings.figure(kpi)
    known = np.flatnonzero(np.isfinite(figures))
    if not known.size:
        return Cell("-" if judgment.worst is None else "not defined")
    value = float(figures[known[0] if judgment.worst is None else judgment.worst])
    return figure_cell(findings, kpi, value)


def figure_cell(
    findings: Findings, name: str, value: float, *, is_difference: bool = False
) -> Cell:
    """Return the cell of a value of a key figure; see `figure_text`."""
    unit = findings.units[name]
    text = figure_text(findings, name, value, is_difference=is_difference)
    return Cell(text, value=value, unit=difference_unit(unit) if is_difference else unit)


def figure_text(
    findings: Findings, name: str, value: float, digits: int = 4, *, is_difference: bool = False
) -> str:
    """Return a value of a key figure in the unit of the figure's cases, that of its axes too.

    Parameters
    ----------
    name
        The figure.
    value
        The value, or a difference of two, in the figure's SI unit; NaN where it is not defined.
    digits
        Significant digits.
    is_difference
        Whether it is one: of temperatures they are in K.
    """
    unit = findings.units[name]
    return amount(
        value, difference_unit(unit) if is_difference else unit, digits, findings.size(name)
    )


def strongest(drivers: Iterable[Sequence[object]]) -> str:
    """Return how many of the quantities that drive each figure have bars; empty where all have."""
    count = max(map(len, drivers), default=0)
    return f" Shown are the {BARS} strongest of {count} quantities." if count > BARS else ""


def percent(value: float, of: Share) -> str:
    """Return a probability in the digits that its interval leaves.

    Examples
    --------
    >>> percent(0.98765, Share(98765, 100000, 0.98694, 0.98833))
    '98.77 %'
    >>> percent(1.0, Share(1000, 1000, 0.9963, 1.0)), percent(0.5, Share(5, 10, 0.19, 0.81))
    ('100.00 %', '50 %')
    """
    width = 100.0 * (of.high - of.low)
    digits = 0 if width >= 10 else 1 if width >= 1 else 2 if width >= 0.1 else 3
    return f"{100.0 * value:.{digits}f} %"


def spread_blocks(findings: Findings) -> list[TableBlock | Listing]:
    """Return the table of key figures, and which ones no case has; nothing where there are none."""
    if not findings.spreads:
        return []
    absent = [name for name in findings.units if name not in {s.name for s in findings.spreads}]
    said = [Listing([f"not defined in any case: {', '.join(absent)}"])] if absent else []
    return [TableBlock(spread_table(findings), width=140), *said]


def spread_table(findings: Findings) -> Table:
    """Return the key figures: the bench itself, percentiles of drawn cases, and ends."""
    is_sampled = findings.plan.is_sampled
    heads = ["the bench itself", *["5 %", "median", "95 %"] * is_sampled, "least", "largest"]
    rows = []
    for each in findings.spreads:
        middle = [q.value for q in each.quantiles] if is_sampled else []
        values = [each.nominal, *middle, each.least, each.largest]
        name = clean(each.name)
        name += f" (not defined in {each.undefined})" if each.undefined else ""
        cells = (figure_cell(findings, each.name, v) for v in values)
        rows.append((Cell(name), *cells))
    return Table((Column("name"), *(Column(h, numeric=True) for h in heads)), tuple(rows))


def varied_table(plan: StudyPlan) -> Table:
    """Return what varies, and how."""
    return text_table(
        ["quantity", "in the bench", "distribution", "together with it"],
        [
            (
                v.name,
                value_text(v.nominal, v.unit or "1"),
                v.distribution.text,
                ", ".join(v.together) or "-",
            )
            for v in plan.varied
        ],
    )


def correlated(plan: StudyPlan) -> list[Listing]:
    """Return which quantities go together, where any do."""
    texts = [
        f"{first} and {second}: correlation {value:.3g} of their normal scores"
        for (first, second), value in plan.correlations.items()
    ]
    return [Listing(texts)] if texts else []


def influence_tables(findings: Findings) -> list[TableBlock]:
    """Return what drives each key figure of a requirement; of all where nothing is required."""
    if not findings.plan.is_sampled:
        return []
    each = {name: findings.influences(name) for name in shown_figures(findings)}
    is_partial = bool(findings.plan.correlations)
    return [
        TableBlock(
            _influence_table(found, is_partial),
            f"What drives {name}{_more(found)}.",
            title=f"what drives {name}{_more(found)}",
        )
        for name, found in each.items()
        if found
    ]


def effect_tables(findings: Findings) -> list[TableBlock]:
    """Return what each quantity alone does to key figures of requirements, or to all."""
    return [
        TableBlock(
            _effect_table(findings, name, found),
            f"What each quantity alone does to {name}.",
            title=f"what moves {name}",
        )
        for name, found in moving_effects(findings).items()
    ]


def moving_effects(findings: Findings) -> dict[str, Sequence[Effect]]:
    """Return the effects on each of the key figures that matter, those that nothing moves apart."""
    each = {name: findings.effects(name) for name in shown_figures(findings)}
    return {name: found for name, found in each.items() if any(e.swing or e.lacking for e in found)}


def _effect_table(findings: Findings, name: str, effects: Sequence[Effect]) -> Table:
    heads = ("from", "to", "at the first", "at the last", "least", "largest", "swing")
    rows = []
    for each in effects:
        ends = [value_text(each.values[k], each.unit or "1") for k in (0, -1)]
        figures = [float(each.figures[0]), float(each.figures[-1]), each.least, each.largest]
        rows.append(
            (
                Cell(each.quantity),
                *map(Cell, ends),
                *(figure_cell(findings, name, v) for v in figures),
                figure_cell(findings, name, each.swing, is_difference=True),
            )
        )
    return Table((Column("quantity"), *(Column(h, numeric=True) for h in heads)), tuple(rows))


def shown_figures(findings: Findings) -> list[str]:
    """Return the key figures that matter: those that something is required of, else all.

    Those of requirements that are missed come first, then those that are undecided.
    """
    known = [each.name for each in findings.spreads]
    judgments = findings.judgments if known else ()
    ordered = sorted(judgments, key=lambda each: _URGENCY.index(each.outcome))
    judged = [each.demand.figure for each in ordered]
    required = [
        *judged,
        *(each.figure for each in findings.plan.demands if each.figure not in judged),
    ]
    return [name for name in required if name in known] if required else known


def unmoved(findings: Findings) -> list[str]:
    """Return in a sentence which of the key figures that matter are the same in every case.

    Of designs for indices, which say so themselves, and of rare failures, nothing.
    """
    if not (findings.plan.is_sampled or findings.plan.design == ONE):
        return []
    shown = shown_figures(findings)
    same = [
        each.name for each in findings.spreads if each.name in shown and each.least == each.largest
    ]
    return [f"nothing moves {', '.join(same)}: the same in every case"] if same else []


def _more(influences: Sequence[object]) -> str:
    """Return how many quantities a table leaves out, and where they are."""
    rest = len(influences) - _SHOWN
    return f", the {_SHOWN} strongest, and {rest} more in report.json" if rest > 0 else ""


def _influence_table(influences: Sequence[Influence | ChoiceInfluence], is_partial: bool) -> Table:
    """Return rank correlations; where choices are among them, their ratios in a column beside."""
    heads = [f"{'partial ' * is_partial}rank correlation", "interval"]
    has_choices = any(isinstance(i, ChoiceInfluence) for i in influences)
    if has_choices:
        heads.append("correlation ratio")
    rows = []
    for i in influences[:_SHOWN]:
        name = i.quantity
        if isinstance(i, ChoiceInfluence):
            name += " (choice)"
            cells = ["-", "-", f"{i.correlation_ratio:.2f}"]
        else:
            cells = [f"{i.correlation:+.2f}", f"{i.low:+.2f} to {i.high:+.2f}"]
            cells += ["-"] * has_choices
        rows.append((name, *cells, "yes" if i.is_distinct else "not distinct from none"))
    return text_table(["quantity", *heads, "drives it"], rows)
