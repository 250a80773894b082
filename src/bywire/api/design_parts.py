"""A design in words and as a JSON object."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from bywire.analysis.loop_figures import LOOP_FIGURES
from bywire.api.loop_case import LoopCase
from bywire.api.verification_parts import (
    Part,
    figure_cell,
    figure_text,
    verification_object,
    verification_parts,
)
from bywire.bench.requirements import Limit
from bywire.core.callers import option
from bywire.core.parameters import leaf_fields
from bywire.report.document import Flat, Listing, TableBlock
from bywire.report.tables import text_table
from bywire.report.wording import amount
from bywire.synthesis.outcome import Design
from bywire.synthesis.verification import Verification


def as_object(
    case: LoopCase,
    requirements: Sequence[Limit],
    design: Design,
    tried: Verification | None,
) -> dict[str, Any]:
    """Return everything as plain data."""
    final = design.gains if tried is None else tried.final.gains
    return {
        "loop": case.loop.name,
        "parameters": case.name,
        "operating_point": {case.loop.at.name: case.value, "unit": case.loop.at.unit},
        "requirements": [str(requirement) for requirement in requirements],
        "status": design.status,
        "gains": dict(final),
        "gain_units": {name: unit_of(case, name) for name in final},
        "linear": {
            "gains": dict(design.gains),
            "units": {name: figure.unit for name, figure in LOOP_FIGURES.items()},
            "nominal": dict(design.nominal),
            "worst": {k: {"value": v, "at": at} for k, (v, at) in design.worst.items()},
            "slack": design.slack,
            "kept": [str(requirement) for requirement in design.kept],
            "binding": [
                {
                    "requirement": str(binding.requirement),
                    "at": binding.case,
                    "value": binding.value,
                    "slack": binding.slack,
                }
                for binding in design.binding
            ],
            "unsound": dict(design.unsound),
            "conflicts": [
                {
                    "requirement": str(conflict.wanted),
                    "best": conflict.best,
                    "with": str(conflict.kept),
                    "excluded": conflict.excludes,
                }
                for conflict in design.conflicts
            ],
        },
        "bench": None if tried is None else verification_object(case, tried),
    }


def as_parts(
    case: LoopCase,
    requirements: Sequence[Limit],
    design: Design,
    tried: Verification | None,
) -> list[Part]:
    """Return what a person wants to know, in tables and sentences."""
    at = case.loop.at
    point = f"{at.name} = {amount(case.value, at.unit)}"
    parts: list[Part] = [
        f"loop {case.loop.name} of {case.name} at {point}: linear design {design.status}"
    ]
    final = design.gains if tried is None else tried.final.gains
    heading = ["gain", "linear design"]
    rows = [[name, gain_text(case, name, value)] for name, value in design.gains.items()]
    if tried is not None and tried.tuning is not None:
        heading.append("retuned on the bench")
        rows = [[*row, gain_text(case, row[0], final[row[0]])] for row in rows]
    parts.append(text_table(heading, rows))
    wanted = {requirement.figure: str(requirement) for requirement in (*requirements, *design.kept)}
    figures = [
        [
            name,
            figure_cell(name, design.nominal[name]),
            figure_cell(name, design.worst[name][0]),
            design.worst[name][1],
            wanted.get(name, "").removeprefix(name).strip(),
        ]
        for name in LOOP_FIGURES
    ]
    parts.append(text_table(["linear", "nominal", "worst", "at", "wanted"], figures))
    parts += kept_lines(design) + unsound_lines(design)
    parts += [
        f"{'binds' if design.binds else 'tightest'}: {binding.requirement}, "
        f"{figure_text(binding.requirement.figure, binding.value)} at {binding.case}"
        for binding in design.binding
    ]
    parts += [
        f"{conflict.wanted}: at best {amount(conflict.best, conflict.wanted.unit, 3)} "
        f"with {conflict.kept}"
        for conflict in design.conflicts
    ]
    if tried is not None:
        parts += verification_parts(case, design.nominal, tried)
    return parts


def kept_lines(design: Design) -> list[str]:
    """Return what is kept besides the requirements, a sentence or none."""
    if not design.kept:
        return []
    texts = ", ".join(str(requirement) for requirement in design.kept)
    return [f"kept besides: {texts} (require another limit of the same figure to change it)"]


def unsound_lines(design: Design) -> list[str]:
    """Return which models have no figures, and why, a sentence for each reason."""
    states = dict.fromkeys(design.unsound.values())
    return [
        f"{state}, at {', '.join(k for k, why in design.unsound.items() if why == state)}"
        for state in states
    ]


def limit_lines(case: LoopCase, limits: Mapping[str, tuple[float, float]]) -> list[str]:
    """Return what was kept so that an ECU can run the gains, a sentence or none."""
    if not limits:
        return []
    texts = [
        f"{name} = {gain_text(case, name, low)}"
        if low == high
        else f"{name} >= {gain_text(case, name, low)}"
        for name, (low, high) in limits.items()
    ]
    return [f"kept for an ECU: {', '.join(texts)} ({option('free_derivative')} does not)"]


def unit_of(case: LoopCase, name: str) -> str:
    """Return the unit of a gain."""
    return leaf_fields(type(case.par))[name].unit.symbol


def gain_text(case: LoopCase, name: str, value: float) -> str:
    """Return a gain with its unit."""
    return amount(value, unit_of(case, name))


def as_blocks(parts: Sequence[Part]) -> list[Flat]:
    """Return tables, and the sentences between them as lists."""
    blocks: list[Flat] = []
    lines: list[str] = []
    for part in [*parts, None]:
        if isinstance(part, str):
            lines.append(part.strip())
            continue
        if lines:
            blocks.append(Listing(lines))
            lines = []
        if part is not None:
            blocks.append(TableBlock(part))
    return blocks
