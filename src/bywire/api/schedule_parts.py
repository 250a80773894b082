"""A gain schedule in words and as a JSON object."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from bywire.api.design_parts import gain_text, kept_lines, unit_of
from bywire.api.loop_case import LoopCase
from bywire.api.verification_parts import (
    Part,
    figure_text,
    verification_object,
    verification_parts,
)
from bywire.core.units import shown
from bywire.report.tables import Table, text_table
from bywire.report.wording import amount
from bywire.synthesis.outcome import Across, ScheduleDesign
from bywire.synthesis.requirement import FIGURES, Requirement
from bywire.synthesis.schedule_designer import scheduled
from bywire.synthesis.verification import Verification

_SEEN = ("bandwidth", "crossover", "phase_margin", "gain_margin", "disk_margin", "overshoot")


def as_object(
    case: LoopCase,
    requirements: Sequence[Requirement],
    found: ScheduleDesign,
    tried: Verification | None,
    retuned: Sequence[Across],
) -> dict[str, Any]:
    """Return everything as plain data."""
    final = found.gains if tried is None else tried.final.gains
    at = case.loop.at
    return {
        "loop": case.loop.name,
        "parameters": case.name,
        "operating_points": {"unit": at.unit, **{k: list(v) for k, v in found.points.items()}},
        "borders": {name: case.par.leaves()[name] for name in scheduled(case.loop).borders},
        "requirements": [one.text for one in requirements],
        "status": found.status,
        "gains": dict(final),
        "gain_units": {name: unit_of(case, name) for name in final},
        "regions": {
            region: {
                "status": one.status, "gains": dict(one.gains), "slack": one.slack,
                "binding": [
                    {"requirement": b.requirement.text, "at": b.case, "value": b.value,
                     "slack": b.slack}
                    for b in one.binding
                ],
            }
            for region, one in found.regions.items()
        },
        "across": {
            "units": {name: kind.unit for name, kind in FIGURES.items()},
            "cases": [_case(one, at.name) for one in found.across],
            "worst": _case(found.worst, at.name),
            "retuned": [_case(one, at.name) for one in retuned],
        },
        "bench": None if tried is None else verification_object(case, tried),
    }  # fmt: skip


def _case(one: Across, name: str) -> dict[str, Any]:
    return {name: one.at, "region": one.region, "slack": one.slack, **dict(one.figures)}


def as_parts(
    case: LoopCase,
    found: ScheduleDesign,
    tried: Verification | None,
    retuned: Sequence[Across],
) -> list[Part]:
    """Return what a person wants to know, in tables and sentences.

    ``retuned`` is the loop across the regions with the gains of the bench; empty where these are
    the linear design's.
    """
    at, leaves = case.loop.at, case.par.leaves()
    borders = " and ".join(shown(leaves[one], at.unit) for one in scheduled(case.loop).borders)
    parts: list[Part] = [
        f"gain schedule of loop {case.loop.name} of {case.name}, borders at {at.name} = "
        f"{borders}: linear design {found.status}",
        _gains(case, found, found.gains, "linear design"),
    ]
    if tried is not None and tried.tuning is not None:
        parts.append(_gains(case, found, tried.final.gains, "retuned on the bench"))
    for region, one in found.regions.items():
        where = ", ".join(shown(point, at.unit) for point in found.points[region])
        bound = ", ".join(
            f"{b.requirement.text} ({figure_text(b.requirement.figure, b.value)})"
            for b in one.binding
        )
        word = "binds" if one.binds else "tightest"
        parts.append(f"{region}, designed at {where}: {one.status}; {word}: {bound}")
        parts += [f"  {line}" for line in kept_lines(one)]
        parts += [
            f"  {c.wanted.text}: at best {amount(c.best, c.wanted.unit, 3)} with {c.kept.text}"
            for c in one.conflicts
        ]
    for title, across in (("linear design", found.across), ("retuned gains", retuned)):
        if across:
            parts.append(f"{title}, gains frozen, linear model, room as a share of the limit:")
            parts += _frozen(case, across)
    if tried is not None:
        parts += verification_parts(case, found.nominal, tried)
    return parts


def _frozen(case: LoopCase, across: Sequence[Across]) -> list[Part]:

    at = case.loop.at
    rows = [
        [
            f"{shown(one.at, at.unit)}", one.region,
            *(figure_text(name, one.figures[name]) for name in _SEEN),
            f"{100.0 * one.slack:+.1f} %",
        ]
        for one in across
    ]  # fmt: skip
    worst = min(across, key=lambda one: one.slack)
    where = f"{at.name} = {shown(worst.at, at.unit)}"
    return [
        text_table([at.name, "region", *_SEEN, "least room"], rows),
        f"worst at {where}: {100.0 * worst.slack:+.1f} % of a limit",
    ]


def _gains(
    case: LoopCase, found: ScheduleDesign, gains: Mapping[str, float], title: str
) -> Table:
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
