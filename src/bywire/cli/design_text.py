"""A design in words and as a JSON object."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bywire.api.loop_case import LoopCase
from bywire.cli.verification_text import (
    figure_text,
    finite,
    number,
    verification_object,
    verification_parts,
)
from bywire.core.parameters import leaf_fields
from bywire.synthesis.outcome import Design
from bywire.synthesis.requirement import FIGURES, Requirement
from bywire.synthesis.verification import Verification

if TYPE_CHECKING:
    from bywire.cli.verification_text import Part


def as_object(
    chosen: LoopCase,
    requirements: Sequence[Requirement],
    found: Design,
    tried: Verification | None,
    files: Sequence[Path],
) -> dict[str, Any]:
    """Return everything as plain data; null for what is infinite or not defined."""
    final = found.gains if tried is None else tried.final.gains
    return {
        "loop": chosen.loop.name,
        "parameters": chosen.name,
        "operating_point": {chosen.loop.at.name: chosen.value, "unit": chosen.loop.at.unit},
        "requirements": [one.text for one in requirements],
        "status": found.status,
        "gains": dict(final),
        "gain_units": {name: unit_of(chosen, name) for name in final},
        "linear": {
            "gains": dict(found.gains),
            "units": {name: kind.unit for name, kind in FIGURES.items()},
            "nominal": finite(found.nominal),
            "worst": {k: {"value": number(v), "at": at} for k, (v, at) in found.worst.items()},
            "slack": number(found.slack),
            "kept": [one.text for one in found.kept],
            "binding": [
                {"requirement": one.requirement.text, "at": one.case,
                 "value": number(one.value), "slack": number(one.slack)}
                for one in found.binding
            ],
            "conflicts": [
                {"requirement": one.wanted.text, "best": number(one.best), "with": one.kept.text,
                 "excluded": one.excludes}
                for one in found.conflicts
            ],
        },
        "bench": None if tried is None else verification_object(chosen, tried),
        "files": [str(path) for path in files],
    }  # fmt: skip


def as_parts(
    chosen: LoopCase,
    requirements: Sequence[Requirement],
    found: Design,
    tried: Verification | None,
) -> list[Part]:
    """Return what a person wants to know, in tables and sentences."""
    from bywire.report.tables import text_table
    from bywire.report.wording import amount

    at = chosen.loop.at
    point = f"{at.name} = {amount(chosen.value, at.unit)}"
    parts: list[Part] = [
        f"loop {chosen.loop.name} of {chosen.name} at {point}: linear design {found.status}"
    ]
    final = found.gains if tried is None else tried.final.gains
    heading = ["gain", "linear design"]
    rows = [[name, gain_text(chosen, name, value)] for name, value in found.gains.items()]
    if tried is not None and tried.tuning is not None:
        heading.append("retuned on the bench")
        rows = [[*row, gain_text(chosen, row[0], final[row[0]])] for row in rows]
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
        parts += verification_parts(chosen, found.nominal, tried)
    return parts


def kept_lines(found: Design) -> list[str]:
    """Return what is kept besides the requirements, a sentence or none."""
    if not found.kept:
        return []
    texts = ", ".join(one.text for one in found.kept)
    return [f"kept besides: {texts} (require another limit of the same figure to change it)"]


def unit_of(chosen: LoopCase, name: str) -> str:
    """Return the unit of a gain."""
    return leaf_fields(type(chosen.par))[name].unit.symbol


def gain_text(chosen: LoopCase, name: str, value: float) -> str:
    """Return a gain with its unit."""
    from bywire.report.wording import amount

    return amount(value, unit_of(chosen, name))
