"""The figures of a study, in the order in which its report shows them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from bywire.api.study_rare import rare_figures
from bywire.api.study_sensitivity import sensitivity_figures
from bywire.api.study_tables import shown_figures
from bywire.bench.requirements import limit_of
from bywire.report.document import Block, FigureBlock
from bywire.studies.findings import Findings
from bywire.studies.plan import CHUNK
from bywire.studies.statistics import running_share

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

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
        return [*rare_figures(findings), *_scatters(findings), *_overlays(recordings)]
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
            "correlations with their intervals. Pale: not "
            "distinct from none.", "influences",
        ))  # fmt: skip
    if any(findings.effects(name) for name in figures):
        blocks.append(FigureBlock(
            partial(_tornado, findings),
            "How far each quantity alone moves the key figures from what the bench itself gives; "
            "marks are its levels, dotted the limit.", "tornado",
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
        blocks.append(FigureBlock(
            partial(_parallel, findings),
            "Every case as a line; in front, those that miss a requirement.", "parallel",
        ))  # fmt: skip
        blocks += _overlays(recordings)
    return blocks


def _scatters(findings: Findings) -> list[Block]:
    return [
        FigureBlock(
            partial(_scatter, findings, name),
            f"{name.replace('_', ' ')} over what drives it most; crosses miss the limit.",
            f"scatter-{name}",
        )
        for judgment in findings.judgments if findings.drivers(name := judgment.demand.kpi)
    ]  # fmt: skip


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


def _scatter(findings: Findings, name: str) -> Figure:
    from bywire.report.study.scatter import Axis, scatter

    units = {v.name: v.unit for v in findings.plan.varied}
    judgment = next(j for j in findings.judgments if j.demand.kpi == name)
    drivers = [
        Axis(each, units[each], np.asarray(findings.cases[each], dtype=float))
        for each in findings.drivers(name)[:_DRIVERS]
    ]
    own = Axis(name, findings.units[name], findings.figure(name))
    limit = _limit(findings, name)
    assert limit is not None
    return scatter(own, drivers, limit, judgment.met)


def _convergence(findings: Findings) -> Figure:
    from bywire.report.study.convergence import convergence

    shown = findings.judgments[:_PANELS]
    return convergence(
        {j.demand.text: running_share(j.met, findings.plan.confidence, _SHARES) for j in shown},
        {j.demand.text: j.demand.probability for j in shown}, first=CHUNK,
    )  # fmt: skip


def _parallel(findings: Findings) -> Figure:
    from bywire.report.study.scatter import Axis, parallel_coordinates

    units = {v.name: v.unit for v in findings.plan.varied if v.unit}
    figures = [each.demand.kpi for each in findings.judgments]
    ranked = [each for name in figures for each in findings.drivers(name)[:_DRIVERS]]
    names = list(dict.fromkeys([*ranked, *units]))[: max(_AXES - len(figures), 2)]
    axes = [Axis(n, units[n], np.asarray(findings.cases[n], dtype=float)) for n in names]
    axes += [Axis(n, findings.units[n], findings.figure(n)) for n in figures]
    met = np.all([j.met for j in findings.judgments], axis=0)
    limits = {name: limit for name in figures if (limit := _limit(findings, name)) is not None}
    return parallel_coordinates(axes, met, limits)


def _overlays(recordings: Recordings) -> list[Block]:
    return [
        FigureBlock(
            partial(_overlaid, each),
            f"The bench itself and the worst cases of each requirement (run: {label}).",
            f"worst-{label}", is_long=True,
        )
        for label, each in recordings().items() if len(each) > 1
    ]  # fmt: skip


def _overlaid(each: Mapping[str, xr.Dataset]) -> Figure:
    from bywire.report.overlaid_panels import overlaid_panels

    return overlaid_panels(each)
