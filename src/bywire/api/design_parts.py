"""A design in words and as a JSON object."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from bywire.api.loop_case import LoopCase
from bywire.api.verification_parts import (
    Part,
    figure_text,
    verification_object,
    verification_parts,
)
from bywire.core.parameters import leaf_fields
from bywire.report.tables import text_table
from bywire.report.wording import amount
from bywire.synthesis.outcome import Design
from bywire.synthesis.requirement import FIGURES, Requirement
from bywire.synthesis.verification import Verification


def as_object(
    case: LoopCase,
    requirements: Sequence[Requirement],
    found: Design,
    tried: Verification | None,
) -> dict[str, Any]:
    """Return everything as plain data."""
    final = found.gains if tried is None else tried.final.gains
    return {
        "loop": case.loop.name,
        "parameters": case.name,
        "operating_point": {case.loop.at.name: case.value, "unit": case.loop.at.unit},
        "requirements": [one.text for one in requirements],
        "status": found.status,
        "gains": dict(final),
        "gain_units": {name: unit_of(case, name) for name in final},
        "linear": {
            "gains": dict(found.gains),
            "units": {name: kind.unit for name, kind in FIGURES.items()},
            "nominal": dict(found.nominal),
            "worst": {k: {"value": v, "at": at} for k, (v, at) in found.worst.items()},
            "slack": found.slack,
            "kept": [one.text for one in found.kept],
            "binding": [
                {"requirement": one.requirement.text, "at": one.case,
                 "value": one.value, "slack": one.slack}
                for one in found.binding
            ],
            "conflicts": [
                {"requirement": one.wanted.text, "best": one.best, "with": one.kept.text,
                 "excluded": one.excludes}
                for one in found.conflicts
            ],
        },
        "bench": None if tried is None else verification_object(case, tried),
    }  # fmt: skip


def as_parts(
    case: LoopCase,
    requirements: Sequence[Requirement],
    found: Design,
    tried: Verification | None,
) -> list[Part]:
    """Return what a person wants to know, in tables and sentences."""
    at = case.loop.at
    point = f"{at.name} = {amount(case.value, at.unit)}"
    parts: list[Part] = [
        f"loop {case.loop.name} of {case.name} at {point}: linear design {found.status}"
    ]
    final = found.gains if tried is None else tried.final.gains
    heading = ["gain", "linear design"]
    rows = [[name, gain_text(case, name, value)] for name, value in found.gains.items()]
    if tried is not None and tried.tuning is not None:
        heading.append("retuned on the bench")
        rows = [[*row, gain_text(case, row[0], final[row[0]])] for row in rows]
    parts.append(text_table(heading, rows))
    wanted = {one.figure: one.text for one in (*requirements, *found.kept)}
    figures = [
        [
            name,
            figure_text(name, found.nominal[name]),
            figure_text(name, found.worst[name][0]),
            found.worst[name][1],
            wanted.get(name, "").removeprefix(name).strip(),
        ]
        for name in FIGURES
    ]
    parts.append(text_table(["linear", "nominal", "worst", "at", "wanted"], figures))
    parts += kept_lines(found)
    parts += [
        f"{'binds' if found.binds else 'tightest'}: {one.requirement.text}, "
        f"{figure_text(one.requirement.figure, one.value)} at {one.case}"
        for one in found.binding
    ]
    parts += [
        f"{one.wanted.text}: at best {amount(one.best, one.wanted.unit, 3)} with {one.kept.text}"
        for one in found.conflicts
    ]
    if tried is not None:
        parts += verification_parts(case, found.nominal, tried)
    return parts


def kept_lines(found: Design) -> list[str]:
    """Return what is kept besides the requirements, a sentence or none."""
    if not found.kept:
        return []
    texts = ", ".join(one.text for one in found.kept)
    return [f"kept besides: {texts} (require another limit of the same figure to change it)"]


def unit_of(case: LoopCase, name: str) -> str:
    """Return the unit of a gain."""
    return leaf_fields(type(case.par))[name].unit.symbol


def gain_text(case: LoopCase, name: str, value: float) -> str:
    """Return a gain with its unit."""
    return amount(value, unit_of(case, name))
