"""The figures of a study, in the order in which its report shows them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from bywire.api.study_rare import rare_figures
from bywire.api.study_sensitivity import sensitivity_figures
from bywire.api.study_tables import shown_figures, strongest
from bywire.bench.requirements import limit_of
from bywire.report.document import Block, FigureBlock
from bywire.report.study.drawn_cases import LINES, POINTS, DrawnCases, drawn_cases
from bywire.studies.findings import Findings
from bywire.studies.judgment import Judgment
from bywire.studies.plan import CHUNK
from bywire.studies.statistics import running_share

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

    from bywire.report.study.case_axis import CaseAxis

_DRIVERS = 3  # quantities that a key figure is drawn over
_AXES = 9  # of parallel coordinates
_PANELS = 4  # requirements whose convergence is drawn
_SHARES = 100  # points of a convergence, spaced by equal ratios

Recordings = Callable[[], Mapping[str, Mapping[str, "xr.Dataset"]]]


def load_drawing() -> None:
    """Load what draws the figures of a study and writes its report, ahead of its findings."""
    from bywire.data import netcdf  # noqa: F401
    from bywire.report import overlaid_panels, page  # noqa: F401
    from bywire.report.study import (  # noqa: F401
        convergence,
        histograms,
        influence_bars,
        parallel_coordinates,
        scatter,
    )


def study_figures(findings: Findings, recordings: Recordings) -> list[Block]:
    """Return the figures of a study; none where no case has a result.

    Parameters
    ----------
    findings
        What was found.
    recordings
        Returns the recordings of the bench itself and of worst cases, by run and by what they are.
    """
    if not findings.spreads:
        return []
    if findings.rare:
        return [*rare_figures(findings), *_scatters(findings), *_overlays(findings, recordings)]
    band = "; the shaded band holds 90 % of them" if findings.plan.is_sampled else ""
    blocks: list[Block] = [
        FigureBlock(
            partial(_histograms, findings),
            f"Spread of the key figures over the cases{band}. Dashed, the bench itself; dotted, "
            "the limit.", "histograms", is_long=True,
        )
    ]  # fmt: skip
    figures = shown_figures(findings)
    if findings.plan.is_sampled and any(findings.influences(name) for name in figures):
        blocks.append(FigureBlock(
            partial(_influences, findings),
            f"What drives the key figures: {'partial ' * bool(findings.plan.correlations)}rank "
            "correlations with their intervals. Pale: not distinct from none."
            f"{_on_choices(findings)}"
            f"{strongest(map(findings.influences, figures))}", "influences",
        ))  # fmt: skip
    if any(findings.effects(name) for name in figures):
        blocks.append(FigureBlock(
            partial(_tornado, findings),
            "How far each quantity alone moves the key figures from what the bench itself gives; "
            "marks are its levels, dotted the limit."
            f"{strongest(map(findings.effects, figures))}", "tornado",
        ))  # fmt: skip
    if findings.plan.sensitivity is not None:
        blocks += sensitivity_figures(findings)
    # Trajectories stand on a few levels: their points would be stripes.
    blocks += _scatters(findings) if findings.plan.design != "morris" else []
    if findings.judgments and findings.plan.is_sampled:
        blocks.append(FigureBlock(
            partial(_convergence, findings),
            "Probability that a requirement is met, as the cases came in; dotted, what is wanted.",
            "convergence",
        ))  # fmt: skip
    if findings.judgments:
        blocks += [_parallel_block(findings), *_overlays(findings, recordings)]
    return blocks


def _scatters(findings: Findings) -> list[Block]:
    return [
        _scatter_block(findings, judgment)
        for judgment in findings.judgments if findings.drivers(judgment.demand.kpi)
    ]  # fmt: skip


def _scatter_block(findings: Findings, judgment: Judgment) -> Block:
    name, met = judgment.demand.kpi, judgment.met
    known = np.isfinite(findings.figure(name))
    cases = drawn_cases(met, POINTS, known=known)
    lacking = cases.lacking.size
    every = "all that have it" if lacking else "all"
    crosses = (
        f"{every} meet the limit" if not cases.all_missed
        else "crosses miss the limit" if cases.all_met else f"{every} miss the limit"
    )  # fmt: skip
    said = [
        f"{name.replace('_', ' ')} over what drives it most; {crosses}.",
        cases.caption("meet the limit", "miss it"),
        f"Triangles at the upper edge: {lacking} cases without it, which miss the limit."
        if lacking else "",
        "Cases gather where failures are: shares of them are no probabilities."
        if findings.rare else "",
    ]  # fmt: skip
    return FigureBlock(
        partial(_scatter, findings, name, cases), " ".join(filter(None, said)), f"scatter-{name}"
    )


def _parallel_block(findings: Findings) -> Block:
    met = np.all([j.met for j in findings.judgments], axis=0)
    cases = drawn_cases(met, LINES, LINES)
    thinned = cases.caption("meet all requirements", "miss one")
    missed = "in front, those that miss a requirement"
    said = missed if cases.all_missed else "all meet all requirements"
    text = f"Cases as lines; {said}. {thinned}" if thinned else f"Every case as a line; {said}."
    if not all(np.isfinite(findings.figure(j.demand.kpi)).all() for j in findings.judgments):
        text += " Where a case does not have a figure, its line goes to 'none'."
    return FigureBlock(partial(_parallel, findings, cases), text, "parallel")


def _on_choices(findings: Findings) -> str:
    if all(v.unit for v in findings.plan.varied):
        return ""
    return " A choice has no order: its correlation ratio stands among their sizes, unsigned."


def _limit(findings: Findings, name: str) -> float | None:
    limits = {demand.kpi: demand.limit for demand in findings.plan.demands}
    return limit_of(name, limits[name], findings.units[name])[1] if name in limits else None


def _histograms(findings: Findings) -> Figure:
    from bywire.report.study.histograms import Spread, histograms

    return histograms({
        each.name: Spread(
            findings.figure(each.name), each.unit, each.nominal, _limit(findings, each.name)
        )
        for each in findings.spreads if each.largest > each.least
    } or {
        each.name: Spread(findings.figure(each.name), each.unit, each.nominal)
        for each in findings.spreads[:1]
    }, has_band=findings.plan.is_sampled)  # fmt: skip


def _influences(findings: Findings) -> Figure:
    from bywire.report.study.influence_bars import influence_bars

    each = {name: findings.influences(name) for name in shown_figures(findings)}
    return influence_bars({name: found for name, found in each.items() if found})


def _tornado(findings: Findings) -> Figure:
    from bywire.report.study.tornado import tornado

    each = {name: findings.effects(name) for name in shown_figures(findings)}
    limits = {name: limit for name in each if (limit := _limit(findings, name)) is not None}
    return tornado({name: found for name, found in each.items() if found}, findings.units, limits)


def _axis(findings: Findings, name: str) -> CaseAxis:
    """Return the axis of a quantity that varies, or of a key figure."""
    from bywire.report.study.case_axis import CaseAxis, choice_axis

    varied = {v.name: v for v in findings.plan.varied}.get(name)
    if varied is None:
        return CaseAxis(name, findings.units[name], findings.figure(name))
    if varied.unit:
        return CaseAxis(name, varied.unit, np.asarray(findings.cases[name], dtype=float))
    choices = [str(choice) for choice in varied.distribution.levels(1)]
    return choice_axis(name, [str(each) for each in findings.cases[name]], choices)


def _scatter(findings: Findings, name: str, cases: DrawnCases) -> Figure:
    from bywire.report.study.scatter import scatter

    drivers = [_axis(findings, each) for each in findings.drivers(name)[:_DRIVERS]]
    limit = _limit(findings, name)
    assert limit is not None
    return scatter(_axis(findings, name), drivers, limit, cases)


def _convergence(findings: Findings) -> Figure:
    from bywire.report.study.convergence import convergence

    shown = findings.judgments[:_PANELS]
    return convergence(
        {j.demand.text: running_share(j.met, findings.plan.confidence, _SHARES) for j in shown},
        {j.demand.text: j.demand.probability for j in shown}, first=CHUNK,
    )  # fmt: skip


def _parallel(findings: Findings, cases: DrawnCases) -> Figure:
    from bywire.report.study.parallel_coordinates import parallel_coordinates

    figures = [each.demand.kpi for each in findings.judgments]
    ranked = [each for name in figures for each in findings.drivers(name)[:_DRIVERS]]
    varied = [v.name for v in findings.plan.varied]
    names = list(dict.fromkeys([*ranked, *varied]))[: max(_AXES - len(figures), 2)]
    axes = [_axis(findings, name) for name in (*names, *figures)]
    limits = {name: limit for name in figures if (limit := _limit(findings, name)) is not None}
    return parallel_coordinates(axes, cases, limits)


def _overlays(findings: Findings, recordings: Recordings) -> list[Block]:
    which = "most probable failing" if findings.rare else "worst"
    return [
        FigureBlock(
            partial(_overlaid, each),
            f"The bench itself and the {which} case of each requirement (run: {label}).",
            f"worst-{label}", is_long=True,
        )
        for label, each in recordings().items() if len(each) > 1
    ]  # fmt: skip


def _overlaid(each: Mapping[str, xr.Dataset]) -> Figure:
    from bywire.report.overlaid_panels import overlaid_panels

    return overlaid_panels(each)
