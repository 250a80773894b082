"""Tables and notes of a study: requirements, key figures, varied quantities, influences."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from bywire.core.units import difference_unit
from bywire.report.document import Listing, TableBlock
from bywire.report.study.drawn_cases import BARS
from bywire.report.tables import OUTCOMES, Cell, Column, Table, text_table, value_text
from bywire.report.wording import amount, clean
from bywire.studies.designs import IMPORTANCE, SUBSET, WORST
from bywire.studies.findings import ONE, ChoiceInfluence, Effect, Findings, Judgment
from bywire.studies.plan import StudyPlan
from bywire.studies.sensitivity import ElementaryEffects, Estimate, VarianceShares
from bywire.studies.sought_cases import Importance, RareFailure
from bywire.studies.statistics import FailureProbability, Influence, Interval, Outcome, Share

if TYPE_CHECKING:
    pass

_URGENCY = ("missed", "undecided", "met")  # outcomes, the most urgent first
_SHOWN = 5  # listed influences on a key figure


def demand_table(findings: Findings) -> Table:
    """Return the requirements: cases that meet them, probability, and verdict."""
    confidence = f"{100.0 * findings.plan.confidence:g} %"
    is_sampled = findings.plan.is_sampled
    is_search = findings.plan.design == WORST  # its fraction of cases means nothing
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
    """Return the worst figure, or the common figure if all cases are equal."""
    kpi, worst = judgment.demand.figure, judgment.worst
    if kpi not in findings.ends:
        return Cell("-" if worst is None else "not defined")
    value = findings.ends[kpi][0] if worst is None else float(findings.row(worst)[kpi])
    return _figure_cell(findings, kpi, value)


def _figure_cell(
    findings: Findings, name: str, value: float, *, is_difference: bool = False
) -> Cell:
    """Return the cell of a key figure's value (see `figure_text`)."""
    unit = findings.units[name]
    text = figure_text(findings, name, value, is_difference=is_difference)
    return Cell(text, value=value, unit=difference_unit(unit) if is_difference else unit)


def figure_text(
    findings: Findings, name: str, value: float, digits: int = 4, *, is_difference: bool = False
) -> str:
    """Return a key figure's value in the unit of its cases and axes.

    Parameters
    ----------
    name
        The figure.
    value
        The value, or a difference of two values, in the figure's SI unit. NaN if it is not defined.
    digits
        Significant digits.
    is_difference
        Whether the value is a difference. Temperature differences are in K.
    """
    unit = findings.units[name]
    return amount(
        value, difference_unit(unit) if is_difference else unit, digits, findings.size(name)
    )


def strongest(drivers: Iterable[Sequence[object]]) -> str:
    """Return a sentence on the number of bars, or an empty text if all quantities have one."""
    count = max(map(len, drivers), default=0)
    return f" Only the {BARS} strongest of {count} quantities are shown." if count > BARS else ""


def percent(value: float, of: Share) -> str:
    """Return a probability with as many digits as its interval justifies.

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
    """Return the table of key figures, and a list of figures that no case has."""
    if not findings.spreads:
        return []
    absent = [name for name in findings.units if name not in {s.name for s in findings.spreads}]
    undefined = [Listing([f"not defined in any case: {', '.join(absent)}"])] if absent else []
    return [TableBlock(spread_table(findings)), *undefined]


def spread_table(findings: Findings) -> Table:
    """Return the key figures: nominal values, percentiles of random cases, and extremes."""
    is_sampled = findings.plan.is_sampled
    heads = ["the bench itself", *["5 %", "median", "95 %"] * is_sampled, "least", "largest"]
    rows = []
    for each in findings.spreads:
        middle = [q.value for q in each.quantiles] if is_sampled else []
        values = [each.nominal, *middle, each.least, each.largest]
        name = clean(each.name)
        name += f" (not defined in {each.undefined})" if each.undefined else ""
        cells = (_figure_cell(findings, each.name, v) for v in values)
        rows.append((Cell(name), *cells))
    return Table((Column("name"), *(Column(h, numeric=True) for h in heads)), tuple(rows))


def varied_table(plan: StudyPlan) -> Table:
    """Return the varied quantities with their distributions."""
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
    """Return the correlated quantities, if there are any."""
    texts = [
        f"{first} and {second}: correlation {value:.3g} of their normal scores"
        for (first, second), value in plan.correlations.items()
    ]
    return [Listing(texts)] if texts else []


def influence_tables(findings: Findings) -> list[TableBlock]:
    """Return the influences on each key figure with a requirement, or on all key figures."""
    if not findings.plan.is_sampled:
        return []
    each = {name: findings.influences(name) for name in shown_figures(findings)}
    is_partial = bool(findings.plan.correlations)
    return [
        TableBlock(
            _influence_table(found, is_partial),
            f"Main influences on {name}{_more(found)}.",
            title=f"main influences on {name}{_more(found)}",
        )
        for name, found in each.items()
        if found
    ]


def effect_tables(findings: Findings) -> list[TableBlock]:
    """Return the effect of each quantity alone on key figures with requirements, or on all."""
    return [
        TableBlock(
            _effect_table(findings, name, found),
            f"Effect of each quantity alone on {name}.",
            title=f"effects on {name}",
        )
        for name, found in moving_effects(findings).items()
    ]


def moving_effects(findings: Findings) -> dict[str, Sequence[Effect]]:
    """Return the effects on each relevant key figure that changes."""
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
                *(_figure_cell(findings, name, v) for v in figures),
                _figure_cell(findings, name, each.swing, is_difference=True),
            )
        )
    return Table((Column("quantity"), *(Column(h, numeric=True) for h in heads)), tuple(rows))


def shown_figures(findings: Findings) -> list[str]:
    """Return the relevant key figures: those with a requirement, otherwise all.

    Figures of missed requirements are first, then those of undecided ones.
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
    """Return a sentence on relevant key figures that are the same in every case.

    Designs for indices report this themselves. Studies of rare failures have no such sentence.
    """
    if not (findings.plan.is_sampled or findings.plan.design == ONE):
        return []
    shown = shown_figures(findings)
    same = [
        each.name for each in findings.spreads if each.name in shown and each.least == each.largest
    ]
    return [f"the same in every case: {', '.join(same)}"] if same else []


def _more(influences: Sequence[object]) -> str:
    """Return the number of quantities that a table omits, and where they are."""
    rest = len(influences) - _SHOWN
    return f" (the {_SHOWN} strongest; report.json contains {rest} more)" if rest > 0 else ""


def _influence_table(influences: Sequence[Influence | ChoiceInfluence], is_partial: bool) -> Table:
    """Return rank correlations, with the correlation ratios of choices in another column."""
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


# --- Rare failures and sensitivities

_VALUES = 3  # maximum number of discrete values of a quantity to show
_SEEN = 0.005  # minimum fraction of failing cases for which a value is shown


def failure_table(findings: Findings) -> Table:
    """Return the requirements: probability of failure, number of cases, and verdict."""
    confidence = f"{100.0 * findings.plan.confidence:g} %"
    heads = ["probability of failure", f"{confidence} interval", "variation", "cases", "admitted"]
    rows = []
    for each in findings.judgments:
        failure, wanted = each.failure, each.demand.probability
        assert failure is not None
        assert wanted is not None
        probable = failure.estimate
        close = f" ({each.undecided} too close)" if each.undecided else ""
        rows.append(
            (
                Cell(clean(f"{each.demand.figure} {each.demand.text}")),
                Cell(_value(probable), value=probable.value),
                Cell(_ends(probable)),
                Cell(
                    "-" if np.isnan(probable.variation) else f"{100.0 * probable.variation:.2g} %"
                ),
                Cell(f"{failure.runs}{close}", value=failure.runs),
                Cell(f"{1.0 - wanted:.3g}"),
                OUTCOMES[each.outcome],
            )
        )
    columns = [Column(head, numeric="interval" not in head) for head in heads]
    return Table((Column("requirement"), *columns, Column("result")), tuple(rows))


def importance_tables(findings: Findings) -> list[TableBlock]:
    """Return where each requirement fails, by quantity."""
    return [
        TableBlock(
            _importance_table(findings, each),
            f"Where {each.demand.figure} fails.",
            title=f"where {each.demand.figure} fails",
        )
        for each in findings.rare
        if each.importance
    ]


def rare_data(failure: FailureProbability, findings: RareFailure) -> dict[str, Any]:
    """Return a failure for JSON, with margins in the key figure's unit."""
    probable = failure.estimate
    return {
        "state": failure.state,
        "failure": {
            "probability": probable.value,
            "variation": probable.variation,
            "low": probable.low,
            "high": probable.high,
        },
        "cases": failure.runs,
        "levels": [{"margin": x.margin, "probability": x.probability} for x in failure.levels],
        "reliability_index": failure.first_order,
        "failing_case": findings.case,
        "importance": {
            i.quantity: {
                "score": i.score,
                "factor": i.factor,
                **({"shares": {str(v): n for v, n in i.shares.items()}} if i.shares else {}),
            }
            for i in findings.importance
        },
    }


def state_texts(findings: Findings) -> list[str]:
    """Return the reason and the next step for each requirement without an estimate."""
    outcomes = {each.demand: each.outcome for each in findings.judgments}
    return [
        f"{each.demand.figure}: {text}"
        for each in findings.rare
        if (text := _state_text(each, findings.plan, outcomes[each.demand]))
    ]


def rare_notes(findings: Findings) -> list[str]:
    """Return notes on rounding, on requirements without a verdict, and on intervals."""
    plan = findings.plan
    design = plan.sought
    assert design is not None
    notes = []
    if design.kind == SUBSET and design.level != design.asked:
        notes.append(
            f"{design.level} cases per level instead of {design.asked}, because the study "
            "computes cases in whole chunks"
        )
    if unjudged := [str(each) for each in plan.demands if each not in plan.judged_demands]:
        notes.append(
            f"no verdict without a required probability: {'; '.join(unjudged)}. Cases from a "
            "failure search are not a random sample"
        )
    notes += [
        f"{each.demand.figure}: the probability of failure is below a thousandth of the limit, so "
        "the search stopped"
        for each in findings.rare
        if each.failure.state == "negligible"
    ]
    for each in findings.judgments if findings.count else ():
        if each.outcome == "undecided" and each.failure and each.failure.state == "done":
            more = (
                "To narrow the interval, increase cases_per_level and use another folder"
                if design.kind == SUBSET
                else "Extend the study"
            )
            notes.append(f"{each.demand.figure}: the interval contains the limit. {more}")
    if design.kind == IMPORTANCE:
        notes.append(
            "importance-sampling may miss failures far from the design point. 'subset-simulation' "
            "searches everywhere"
        )
    return notes


def _state_text(each: RareFailure, plan: StudyPlan, outcome: Outcome) -> str:
    failure = each.failure
    if failure.state == "budget spent":
        so_far = f"the probability is at most {failure.estimate.high:.2g}"
        seen = f"{failure.failed} failing cases are too few for an estimate, and "
        so_far = seen * bool(failure.failed) + so_far
        where = (
            "before the last level"
            if plan.design == SUBSET
            else "during the search for the design point"
        )
        return f"the budget of {plan.cases} cases was spent {where} ({so_far})" + (
            ". Extend the study" if outcome == "undecided" else ""
        )
    if failure.state == "level":
        return "too many cases have the same key figure to rank them. Use 'monte-carlo'"
    if failure.state == "no design point":
        return f"bywire found no design point, because {failure.why}. Use 'subset-simulation'"
    return ""


def _value(probable: Interval) -> str:
    if np.isnan(probable.value):
        return f"below {probable.high:.2g}" if probable.high < 1.0 else "not known"
    return f"{probable.value:.3g}"


def _ends(probable: Interval) -> str:
    return f"{probable.low:.2g} to {probable.high:.2g}"


def _importance_table(findings: Findings, each: RareFailure) -> Table:
    plan = findings.plan
    varied = {v.name: v for v in plan.varied}
    rows = [
        (
            Cell(clean(i.quantity)),
            Cell(_place(i, each, varied[i.quantity].unit)),
            Cell(value_text(varied[i.quantity].nominal, varied[i.quantity].unit or "1")),
            Cell("-" if math.isnan(i.score) else f"{i.score:+.2f}", value=i.score),
            Cell(f"{i.factor:.2f}", value=i.factor),
        )
        for i in each.importance
    ]
    return Table(
        (
            Column("quantity"),
            Column("where failures lie", numeric=True),
            Column("in the bench", numeric=True),
            Column("standard deviations", numeric=True),
            Column("importance", numeric=True),
        ),
        tuple(rows),
    )


def _place(importance: Importance, failure: RareFailure, unit: str) -> str:
    """Return a quantity's value at failures, or the shares of its discrete values."""
    if importance.quantity not in failure.point:
        return "-"
    if not importance.shares:
        return _shown(failure.point[importance.quantity], unit)
    ranked = sorted(importance.shares.items(), key=lambda pair: -pair[1])
    shown = [f"{_shown(v, unit)} {100.0 * share:.0f} %" for v, share in ranked if share >= _SEEN]
    return ", ".join(shown[:_VALUES] + ["..."] * (len(shown) > _VALUES))


def _shown(value: float | str, unit: str) -> str:
    return value if isinstance(value, str) else amount(float(value), unit)


def search_notes(findings: Findings) -> list[str]:
    """Return notes on the meaning of a search for worst cases, and on unfinished searches."""
    plan = findings.plan
    spent = [
        demand.figure
        for demand, each in zip(plan.judged_demands, findings.searches, strict=False)
        if each.state == "budget spent"
    ]
    notes = [f"{plan.design}: a search does not prove that no worse cases exist"]
    if spent:
        notes.append(
            f"{', '.join(spent)}: the budget of {plan.cases} cases was spent before the search "
            "ended. Extend the study"
        )
    return notes


# --- Indices of sensitivity


def sensitivity_tables(findings: Findings) -> list[TableBlock]:
    """Return the indices of each key figure with a requirement, or of all key figures."""
    return [
        TableBlock(
            _table(findings, name, found),
            f"Main influences on {name}.",
            title=f"main influences on {name}",
        )
        for name in shown_figures(findings)
        if (found := findings.sensitivity(name).drivers)
    ]


def drivers_data(findings: Findings, name: str) -> dict[str, Any]:
    """Return the influences, effects, or indices of a key figure for JSON.

    Figures and effects are in the figure's unit, and values of quantities in SI.
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
    """Return a sentence on key figures without indices, with the reasons.

    Designs that do not compute indices have no such sentence.
    """
    if findings.plan.sensitivity is None:
        return []
    reasons: dict[str, list[str]] = {}
    for name in shown_figures(findings):
        if reason := findings.sensitivity(name).missing:
            reasons.setdefault(reason, []).append(name)
    texts = [f"for {', '.join(names)}: {reason}" for reason, names in reasons.items()]
    return [f"no indices {'; '.join(texts)}"] if texts else []


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
    """Return an estimate and its interval."""
    value, low, high = map(written, (of.value, of.low, of.high))
    return [Cell(value, value=of.value), Cell(f"{low} to {high}")]


def _share(value: float) -> str:
    return f"{round(value, 2) + 0.0:.2f}"  # no -0.00
