"""The figures of a study in which each case is drawn: scatters and parallel coordinates."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from bywire.report.document import Block, FigureBlock
from bywire.report.study.drawn_cases import LINES, POINTS, DrawnCases, drawn_cases
from bywire.studies.findings import Findings, Judgment

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from bywire.report.study.cases import CaseAxis

_DRIVERS = 3  # quantities that a key figure is drawn over
_AXES = 9  # of parallel coordinates


def scatters(findings: Findings) -> list[Block]:
    """Return the scatter of each requirement's key figure over what drives it most."""
    return [
        _scatter_block(findings, judgment)
        for judgment in findings.judgments
        if findings.drivers(judgment.demand.figure)
    ]


def _scatter_block(findings: Findings, judgment: Judgment) -> Block:
    name, met = judgment.demand.figure, judgment.met
    known = np.isfinite(findings.figure(name))
    cases = drawn_cases(met, POINTS, known=known)
    lacking = cases.lacking.size
    every = "all that have it" if lacking else "all"
    crosses = (
        f"{every} meet the limit"
        if not cases.all_missed
        else "crosses miss the limit"
        if cases.all_met
        else f"{every} miss the limit"
    )
    said = [
        f"{name.replace('_', ' ')} over what drives it most; {crosses}.",
        cases.caption("meet the limit", "miss it"),
        f"Triangles at the upper edge: cases without it ({lacking}), which miss the limit."
        if lacking
        else "",
        "Cases gather where failures are: shares of them are no probabilities."
        if findings.rare
        else "",
    ]
    return FigureBlock(
        partial(_scatter, findings, name, cases), " ".join(filter(None, said)), f"scatter-{name}"
    )


def parallel(findings: Findings) -> Block:
    """Return every case as a line over what varies and what is required."""
    met = np.all([j.met for j in findings.judgments], axis=0)
    cases = drawn_cases(met, LINES, LINES)
    thinned = cases.caption("meet all requirements", "miss one")
    said = (
        "all meet all requirements"
        if not cases.all_missed
        else "in front, those that miss a requirement"
        if cases.all_met
        else "all miss a requirement"
    )
    text = f"Cases as lines; {said}. {thinned}" if thinned else f"Every case as a line; {said}."
    drawn = _required(findings)
    if not all(np.isfinite(findings.figure(name)).all() for name in drawn):
        text += " Where a case does not have a figure, its line goes to 'none'."
    if absent := [j.demand.figure for j in findings.judgments if j.demand.figure not in drawn]:
        text += f" No case has {', '.join(absent)}."
    return FigureBlock(partial(_parallel, findings, cases), text, "parallel")


def _required(findings: Findings) -> list[str]:
    """Return the required key figures that some case has."""
    known = {each.name for each in findings.spreads}
    return [j.demand.figure for j in findings.judgments if j.demand.figure in known]


def _axis(findings: Findings, name: str) -> CaseAxis:
    """Return the axis of a quantity that varies, or of a key figure."""
    from bywire.report.study.cases import CaseAxis, choice_axis

    varied = {v.name: v for v in findings.plan.varied}.get(name)
    if varied is None:
        return CaseAxis(name, findings.units[name], findings.figure(name))
    if varied.unit:
        return CaseAxis(name, varied.unit, np.asarray(findings.cases[name], dtype=float))
    choices = [str(choice) for choice in varied.distribution.levels(1)]
    return choice_axis(name, [str(each) for each in findings.cases[name]], choices)


def _scatter(findings: Findings, name: str, cases: DrawnCases) -> Figure:
    from bywire.report.study.cases import scatter

    drivers = [_axis(findings, each) for each in findings.drivers(name)[:_DRIVERS]]
    limit = bound_of(findings, name)
    assert limit is not None
    return scatter(_axis(findings, name), drivers, limit, cases)


def _parallel(findings: Findings, cases: DrawnCases) -> Figure:
    from bywire.report.study.cases import parallel_coordinates

    figures = _required(findings)
    ranked = [each for name in figures for each in findings.drivers(name)[:_DRIVERS]]
    varied = [v.name for v in findings.plan.varied]
    names = list(dict.fromkeys([*ranked, *varied]))[: max(_AXES - len(figures), 2)]
    axes = [_axis(findings, name) for name in (*names, *figures)]
    limits = {name: limit for name in figures if (limit := bound_of(findings, name)) is not None}
    return parallel_coordinates(axes, cases, limits)


def bound_of(findings: Findings, name: str) -> float | None:
    """Return the limit of a key figure in its unit; None where nothing is required of it."""
    return next((each.bound for each in findings.plan.demands if each.figure == name), None)
