"""The figures of a study, in the order of its report."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from bywire.api.study_tables import moving_effects, shown_figures, strongest
from bywire.report.document import Block, FigureBlock
from bywire.report.study.drawn_cases import CROSSES, LINES, POINTS, CaseSelection, DrawnCases
from bywire.studies.findings import Effect, Findings, Judgment
from bywire.studies.plan import CHUNK
from bywire.studies.sought_cases import RareFailure
from bywire.studies.statistics import Spread

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

    from bywire.report.study.cases import CaseAxis
    from bywire.report.study.probabilities import Curve, Histogram

_DRIVERS = 3  # quantities on the axes of a key figure's scatter plots
_AXES = 9  # of parallel coordinates


def case_figures(findings: Findings) -> tuple[list[Block], list[Block]]:
    """Return figures of single cases, which one pass over all cases selects.

    Returns
    -------
    tuple
        Scatter plots of each requirement's key figure versus its main influences, and parallel
        coordinates with a line for each case over quantities and figures. Both may be empty.
    """
    if not findings.judgments:
        return [], []
    # Trajectories use only a few levels, so their points would form stripes.
    has_scatters = findings.plan.design != "morris"
    judgments = [
        j for j in findings.judgments if has_scatters and findings.drivers(j.demand.figure)
    ]
    points = [
        CaseSelection(j.known_met, j.known - j.known_met, POINTS, CROSSES, j.share.cases - j.known)
        for j in judgments
    ]
    lines = CaseSelection(findings.met, findings.count - findings.met, LINES, LINES)
    demands = [j.demand for j in findings.judgments]
    axes = {j.demand: _scatter_names(findings, j.demand.figure) for j in judgments}
    across = [] if findings.rare else _parallel_names(findings)
    names = {*across, *(each.figure for each in demands), *(n for a in axes.values() for n in a)}
    for block in findings.blocks(sorted(names)):
        met = {each: each.is_met(np.asarray(block[each.figure], dtype=float)) for each in demands}
        for judgment, selection in zip(judgments, points, strict=True):
            demand = judgment.demand
            known = np.isfinite(np.asarray(block[demand.figure], dtype=float))
            columns = {name: block[name] for name in axes[demand]}
            selection.add(columns, met[demand], known)
        if across:
            lines.add({name: block[name] for name in across}, np.all([*met.values()], axis=0))
    drawn = [_scatter_block(findings, j, p.cases) for j, p in zip(judgments, points, strict=True)]
    return drawn, [_parallel_block(findings, lines.cases)] if across else []


def _scatter_block(findings: Findings, judgment: Judgment, cases: DrawnCases) -> Block:
    name = judgment.demand.figure
    lacking = cases.all_lacking
    every = "all cases in which it is defined" if lacking else "all"
    crosses = (
        f"{every} meet the limit"
        if not cases.all_missed
        else "crosses miss the limit"
        if cases.all_met
        else f"{every} miss the limit"
    )
    sentences = [
        f"{name.replace('_', ' ')} versus its main influences. {crosses.capitalize()}.",
        cases.caption("meet the limit", "miss it"),
        f"Triangles at the top mark cases in which the key figure is not defined ({lacking}). "
        "They miss the limit."
        if lacking
        else "",
        "Cases concentrate near failures, so the fraction of cases is not a probability."
        if findings.rare
        else "",
    ]
    caption = " ".join(filter(None, sentences))
    return FigureBlock(partial(_scatter, findings, name, cases), caption, f"scatter-{name}")


def _parallel_block(findings: Findings, cases: DrawnCases) -> Block:
    thinned = cases.caption("meet all requirements", "miss one")
    outcome = (
        "all meet all requirements"
        if not cases.all_missed
        else "cases that miss a requirement are in front"
        if cases.all_met
        else "all miss a requirement"
    )
    text = (
        f"Cases as lines; {outcome}. {thinned}" if thinned else f"Every case as a line; {outcome}."
    )
    drawn = _required(findings)
    if any(j.known < j.share.cases for j in findings.judgments if j.demand.figure in drawn):
        text += " The line of a case in which the key figure is not defined goes to 'none'."
    if absent := [j.demand.figure for j in findings.judgments if j.demand.figure not in drawn]:
        text += f" No case has {', '.join(absent)}."
    return FigureBlock(partial(_parallel, findings, cases), text, "parallel")


def _required(findings: Findings) -> list[str]:
    """Return the required key figures that at least one case has."""
    known = {each.name for each in findings.spreads}
    return [j.demand.figure for j in findings.judgments if j.demand.figure in known]


def _scatter_names(findings: Findings, name: str) -> list[str]:
    """Return a key figure and its main influences."""
    return [name, *findings.drivers(name)[:_DRIVERS]]


def _parallel_names(findings: Findings) -> list[str]:
    """Return the quantities and the required key figures on the axes of parallel coordinates."""
    figures = _required(findings)
    ranked = [each for name in figures for each in findings.drivers(name)[:_DRIVERS]]
    varied = [v.name for v in findings.plan.varied]
    return [*dict.fromkeys([*ranked, *varied])][: max(_AXES - len(figures), 2)] + figures


def _axis(findings: Findings, name: str, cases: DrawnCases) -> CaseAxis:
    """Return the axis of a quantity that varies, or of a key figure."""
    from bywire.report.study.cases import CaseAxis, choice_axis

    varied = {v.name: v for v in findings.plan.varied}.get(name)
    column = cases.columns[name]
    if varied is not None and not varied.unit:
        choices = [str(choice) for choice in varied.distribution.levels(1)]
        return choice_axis(name, [str(each) for each in column], choices, cases.rows)
    unit = findings.units[name] if varied is None else varied.unit
    values = np.asarray(column, dtype=float)
    return CaseAxis(name, unit, values, ends=findings.ends.get(name), rows=cases.rows)


def _scatter(findings: Findings, name: str, cases: DrawnCases) -> Figure:
    from bywire.report.study.cases import scatter

    figure, *drivers = (_axis(findings, each, cases) for each in _scatter_names(findings, name))
    limit = _bound_of(findings, name)
    assert limit is not None
    return scatter(figure, drivers, limit, cases)


def _parallel(findings: Findings, cases: DrawnCases) -> Figure:
    from bywire.report.study.cases import parallel_coordinates

    names = _parallel_names(findings)
    axes = [_axis(findings, name, cases) for name in names]
    limits = {
        name: limit
        for name in _required(findings)
        if (limit := _bound_of(findings, name)) is not None
    }
    return parallel_coordinates(axes, cases, limits)


def _bound_of(findings: Findings, name: str) -> float | None:
    """Return the limit of a key figure in its unit, or None without a requirement."""
    return next((each.bound for each in findings.plan.demands if each.figure == name), None)


# --- All figures

_PANELS = 4  # requirements whose convergence is drawn

_Recordings = Callable[[], Mapping[str, Mapping[str, "xr.Dataset"]]]


def load_drawing() -> None:
    """Import the modules for a study's figures and report before its findings are ready."""
    from bywire.data import netcdf  # noqa: F401
    from bywire.report import page, time_traces  # noqa: F401


def study_figures(findings: Findings, recordings: _Recordings) -> list[Block]:
    """Return the figures of a study, or none if no case has a result.

    Parameters
    ----------
    findings
        The study's cases with their verdicts.
    recordings
        Function that returns the recordings of the bench itself and of worst cases, by run and
        label.
    """
    if not findings.spreads:
        return []
    if findings.rare:
        scatters, _ = case_figures(findings)
        return [*_rare_figures(findings), *scatters, *_overlays(findings, recordings)]
    scatters, parallel = case_figures(findings)
    band = (
        ". The shaded band contains 90 % of the cases."
        if findings.plan.is_sampled
        else f". Heights are numbers of cases of {findings.plan.design}, not probabilities."
    )
    blocks: list[Block] = [
        FigureBlock(
            partial(_histograms, findings),
            f"Spread of the key figures over the cases{band} Dashed lines show the bench itself. "
            f"Dotted lines show the limit.",
            "histograms",
            is_long=True,
        )
    ]
    figures = shown_figures(findings)
    if findings.plan.is_sampled and any(findings.influences(name) for name in figures):
        blocks.append(
            FigureBlock(
                partial(_influences, findings),
                f"Influences on the key figures: "
                f"{'partial ' * bool(findings.plan.correlations)}rank "
                "correlations with their intervals. Pale bars cannot be distinguished from zero."
                f"{_on_choices(findings)}"
                f"{strongest(map(findings.influences, figures))}",
                "influences",
            )
        )
    if effects := moving_effects(findings):
        blocks.append(
            FigureBlock(
                partial(_tornado, findings, effects),
                "Effect of each quantity alone on the key figures, starting from the bench itself. "
                "Marks show the quantity's levels. Dotted lines show the limit."
                f"{_on_gray(findings)}{_on_edge(effects)}{strongest(effects.values())}",
                "tornado",
            )
        )
    if findings.plan.sensitivity is not None:
        blocks += _sensitivity_figures(findings)
    blocks += scatters
    if findings.judgments and findings.plan.is_sampled:
        blocks.append(
            FigureBlock(
                partial(_convergence, findings),
                "Probability of meeting a requirement versus the number of cases. Dotted lines "
                "show "
                f"the required probability.{_on_others(findings)}",
                "convergence",
            )
        )
    if findings.judgments:
        blocks += [*parallel, *_overlays(findings, recordings)]
    return blocks


def _on_gray(findings: Findings) -> str:
    return (
        " Gray bars are choices, with the names of their extremes."
        if _has_choices(findings)
        else ""
    )


def _on_edge(effects: Mapping[str, Sequence[Effect]]) -> str:
    if not any(effect.lacking for each in effects.values() for effect in each):
        return ""
    return " A triangle means that the key figure is not defined at some levels."


def _has_choices(findings: Findings) -> bool:
    return any(not v.unit for v in findings.plan.varied)


def _on_choices(findings: Findings) -> str:
    if not _has_choices(findings):
        return ""
    return " A choice has no order, so its bar is the correlation ratio, without a sign."


def _histograms(findings: Findings) -> Figure:
    from bywire.report.study.probabilities import histograms

    varying = [each for each in findings.spreads if each.largest > each.least]
    return histograms(
        {
            each.name: _histogram(each, _bound_of(findings, each.name) if varying else None)
            for each in varying or findings.spreads[:1]
        },
        has_band=findings.plan.is_sampled,
    )


def _histogram(spread: Spread, limit: float | None) -> Histogram:
    from bywire.report.study.probabilities import Histogram

    ends, band = (spread.least, spread.largest), (spread.quantiles[0], spread.quantiles[-1])
    return Histogram(
        spread.counts,
        spread.edges,
        ends,
        (band[0].value, band[1].value),
        spread.unit,
        spread.nominal,
        limit,
    )


def _influences(findings: Findings) -> Figure:
    from bywire.report.study.influences import influence_bars

    each = {name: findings.influences(name) for name in shown_figures(findings)}
    return influence_bars({name: found for name, found in each.items() if found})


def _tornado(findings: Findings, effects: Mapping[str, Sequence[Effect]]) -> Figure:
    from bywire.report.study.influences import tornado

    limits = {name: limit for name in effects if (limit := _bound_of(findings, name)) is not None}
    return tornado(effects, findings.units, limits)


def _convergence(findings: Findings) -> Figure:
    from bywire.report.study.probabilities import convergence

    shown = _converging(findings)[:_PANELS]
    return convergence(
        {str(j.demand): j.running for j in shown},
        {str(j.demand): j.demand.probability for j in shown},
        first=CHUNK,
    )


def _converging(findings: Findings) -> list[Judgment]:
    """Return requirements, starting with those that have a probability and are not met."""
    return sorted(
        findings.judgments, key=lambda j: (j.demand.probability is None, j.outcome == "met")
    )


def _on_others(findings: Findings) -> str:
    others = [str(judgment.demand) for judgment in _converging(findings)[_PANELS:]]
    return f" Not drawn: {'; '.join(others)}." if others else ""


def _overlays(findings: Findings, recordings: _Recordings) -> list[Block]:
    which = "most probable failing" if findings.rare else "worst"
    return [
        FigureBlock(
            partial(_overlaid, each),
            f"The bench itself and the {which} case of each requirement (run: {label}).",
            f"worst-{label}",
            is_long=True,
        )
        for label, each in recordings().items()
        if len(each) > 1
    ]


def _overlaid(each: Mapping[str, xr.Dataset]) -> Figure:
    from bywire.report.time_traces import overlaid_panels

    return overlaid_panels(_alike_once(each))


def _alike_once(each: Mapping[str, xr.Dataset]) -> dict[str, xr.Dataset]:
    """Return recordings by label, with identical ones merged. A case may be worst twice."""
    once: dict[str, xr.Dataset] = {}
    for label, recording in each.items():
        same = next((known for known, other in once.items() if other.equals(recording)), None)
        if same is None:
            once[label] = recording
        else:  # keep its position: colors are assigned in order
            once = {f"{k}, {label}" if k == same else k: other for k, other in once.items()}
    return once


# --- Rare failures and indices of sensitivity

_POINTS = 200  # of a curve
_CAPTIONS = {
    "sobol-indices": "Contribution of each quantity to each key figure's variance, alone and "
    "together with all others, with intervals. Pale bars cannot be distinguished from zero.",
    "morris": "Mean size (with its interval) and standard deviation of each quantity's elementary "
    "effects. Pale bars cannot be distinguished from zero.",
}


def _rare_figures(findings: Findings) -> list[FigureBlock]:
    """Return the figure of probabilities versus the limit, if there are any."""
    if not any(each.failure.span for each in findings.rare):
        return []
    return [
        FigureBlock(
            partial(_curves, findings),
            "Probability that a key figure is worse than a value, with its interval. Dotted lines "
            "show the limit and the permitted probability.",
            "exceedance",
        )
    ]


def _curves(findings: Findings) -> Figure:
    from bywire.report.study.probabilities import exceedance

    return exceedance([_curve(each) for each in findings.rare if each.failure.span])


def _curve(each: RareFailure) -> Curve:
    from bywire.report.study.probabilities import Curve

    demand = each.demand
    assert each.failure.span is not None
    assert demand.probability is not None
    margins = np.linspace(*each.failure.span, _POINTS)
    intervals = [each.failure.below(float(margin)) for margin in margins]
    return Curve(
        demand.figure,
        demand.unit,
        demand.bound,
        1.0 - demand.probability,
        demand.bound + (-1.0 if demand.is_upper else 1.0) * margins,
        np.array([interval.value for interval in intervals]),
        np.array([interval.low for interval in intervals]),
        np.array([interval.high for interval in intervals]),
    )


def _sensitivity_figures(findings: Findings) -> list[FigureBlock]:
    """Return the figure of all indices, if there are any."""
    drivers = [findings.sensitivity(name).drivers for name in shown_figures(findings)]
    if not any(drivers):
        return []
    caption = _CAPTIONS[findings.plan.design] + strongest(drivers)
    return [FigureBlock(partial(_bars, findings), caption, "sensitivity")]


def _bars(findings: Findings) -> Figure:
    from bywire.report.study.influences import sensitivity_bars

    each = {name: findings.sensitivity(name).drivers for name in shown_figures(findings)}
    each = {name: found for name, found in each.items() if found}
    return sensitivity_bars(each, findings.units, {name: findings.size(name) for name in each})
