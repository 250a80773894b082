"""A gain schedule in words and as a JSON object."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from bywire.analysis.loop_figures import LOOP_FIGURES
from bywire.api.design_parts import gain_text, kept_lines, unit_of
from bywire.api.loop_case import LoopCase
from bywire.api.verification_parts import (
    Part,
    figure_cell,
    figure_text,
    verification_object,
    verification_parts,
)
from bywire.bench.requirements import Limit
from bywire.core.units import shown
from bywire.report.tables import Table, text_table
from bywire.report.wording import amount
from bywire.synthesis.outcome import Across, ScheduleDesign
from bywire.synthesis.schedules import scheduled
from bywire.synthesis.verification import Verification

_SEEN = (
    "bandwidth",
    "crossover",
    "phase_margin",
    "gain_margin",
    "lower_gain_margin",
    "disk_margin",
    "overshoot",
)


def as_object(
    case: LoopCase,
    requirements: Sequence[Limit],
    design: ScheduleDesign,
    tried: Verification | None,
    retuned: Sequence[Across],
) -> dict[str, Any]:
    """Return everything as plain data."""
    final = design.gains if tried is None else tried.final.gains
    at = case.loop.at
    return {
        "loop": case.loop.name,
        "parameters": case.name,
        "operating_points": {"unit": at.unit, **{k: list(v) for k, v in design.points.items()}},
        "borders": {name: case.par.leaves()[name] for name in scheduled(case.loop).borders},
        "requirements": [str(requirement) for requirement in requirements],
        "status": design.status,
        "gains": dict(final),
        "gain_units": {name: unit_of(case, name) for name in final},
        "regions": {
            region: {
                "status": regional.status,
                "gains": dict(regional.gains),
                "slack": regional.slack,
                "binding": [
                    {
                        "requirement": str(b.requirement),
                        "at": b.case,
                        "value": b.value,
                        "slack": b.slack,
                    }
                    for b in regional.binding
                ],
            }
            for region, regional in design.regions.items()
        },
        "across": {
            "units": {name: figure.unit for name, figure in LOOP_FIGURES.items()},
            "cases": [_case(across, at.name) for across in design.across],
            "worst": _case(design.worst, at.name),
            "retuned": [_case(across, at.name) for across in retuned],
        },
        "bench": None if tried is None else verification_object(case, tried),
    }


def _case(across: Across, name: str) -> dict[str, Any]:
    return {name: across.at, "region": across.region, "slack": across.slack, **dict(across.figures)}


def as_parts(
    case: LoopCase,
    design: ScheduleDesign,
    tried: Verification | None,
    retuned: Sequence[Across],
) -> list[Part]:
    """Return what a person wants to know, in tables and sentences.

    ``retuned`` is the loop across the regions with the gains of the bench; empty where these are
    the linear design's.
    """
    at, leaves = case.loop.at, case.par.leaves()
    borders = " and ".join(
        shown(leaves[border], at.unit) for border in scheduled(case.loop).borders
    )
    parts: list[Part] = [
        f"gain schedule of loop {case.loop.name} of {case.name}, borders at {at.name} = "
        f"{borders}: linear design {design.status}",
        _gains(case, design, design.gains, "linear design"),
    ]
    if tried is not None and tried.tuning is not None:
        parts.append(_gains(case, design, tried.final.gains, "retuned on the bench"))
    for region, regional in design.regions.items():
        where = ", ".join(shown(point, at.unit) for point in design.points[region])
        bound = ", ".join(
            f"{b.requirement} ({figure_text(b.requirement.figure, b.value)})"
            for b in regional.binding
        )
        word = "binds" if regional.binds else "tightest"
        parts.append(f"{region}, designed at {where}: {regional.status}; {word}: {bound}")
        parts += [f"  {line}" for line in kept_lines(regional)]
        parts += [
            f"  {c.wanted}: at best {amount(c.best, c.wanted.unit, 3)} with {c.kept}"
            for c in regional.conflicts
        ]
    for title, across in (("linear design", design.across), ("retuned gains", retuned)):
        if across:
            parts.append(f"{title}, gains frozen, linear model, room as a share of the limit:")
            parts += _frozen(case, across)
    if tried is not None:
        parts += verification_parts(case, design.nominal, tried)
    return parts


def _frozen(case: LoopCase, across: Sequence[Across]) -> list[Part]:

    at = case.loop.at
    rows = [
        [
            f"{shown(row.at, at.unit)}",
            row.region,
            *(figure_cell(name, row.figures[name]) for name in _SEEN),
            f"{100.0 * row.slack:+.1f} %",
        ]
        for row in across
    ]
    worst = min(across, key=lambda row: row.slack)
    where = f"{at.name} = {shown(worst.at, at.unit)}"
    return [
        text_table([at.name, "region", *_SEEN, "least room"], rows),
        f"worst at {where}: {100.0 * worst.slack:+.1f} % of a limit",
    ]


def _gains(case: LoopCase, design: ScheduleDesign, gains: Mapping[str, float], title: str) -> Table:
    """Return a table of gains, a column for each region."""
    regions = scheduled(case.loop).regions
    cells: dict[str, dict[str, str]] = {}
    for region, spans in regions.items():
        for name in spans:
            if name in gains:
                cells.setdefault(name.rpartition(".")[2], {})[region] = gain_text(
                    case, name, gains[name]
                )
    rows = [[name, *(row.get(region, "") for region in regions)] for name, row in cells.items()]
    return text_table([title, *regions], rows)
