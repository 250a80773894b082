"""The section ``[design]`` of a study file: where it is computed, and how many cases."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from bywire.bench.values import written
from bywire.core.arguments import whole_number
from bywire.core.errors import ParameterError, quoted, unknown_name
from bywire.core.units import parse
from bywire.studies.plan import StudyPlan
from bywire.studies.points import MOST, SAMPLED, SPANNED
from bywire.studies.sensitivity_design import LEVELS, SENSITIVITY
from bywire.studies.sought_design import DEFAULT_CASES, SOUGHT, SUBSET

_DESIGN = ("kind", "cases", "seed", "levels", "confidence", "cases_per_level", "time")
_KINDS = (*SAMPLED, *SPANNED, *SENSITIVITY, *SOUGHT)
_WITH_LEVELS = ("grid", "one-at-a-time")


def read_design(section: Mapping[str, Any]) -> dict[str, Any]:
    """Return what the section says, by the fields of a `StudyPlan`.

    Raises
    ------
    InputError
        For what is unknown or out of range, and what the kind of design has no use for.
    """
    for key in section:
        if key not in _DESIGN:
            raise unknown_name("key of [design]", key, _DESIGN)
    design: dict[str, Any] = {}
    if "kind" in section:
        if section["kind"] not in _KINDS:
            raise unknown_name("[design] kind", str(section["kind"]), _KINDS)
        design["design"] = section["kind"]
    _require_of_use(design.get("design", StudyPlan.design), section)
    if (default := DEFAULT_CASES.get(design.get("design", ""))) is not None:
        design["cases"] = default
    for key, low, high in (
        ("cases", 1, MOST),
        ("seed", 0, 2**63 - 1),
        ("levels", 2, 1000),
        ("cases_per_level", 1, MOST),
    ):
        if key in section:
            design[key] = whole_number(f"[design] {key}", section[key], low, high)
    if "confidence" in section:
        share = parse(section["confidence"], "1", "[design] confidence")
        if not 0.5 <= share < 1.0:
            raise ParameterError(
                f"[design] confidence = {quoted(section['confidence'])} must be at least 50 %, and "
                "below 100 %"
            )
        design["confidence"] = share
    if "time" in section:
        design["time"] = written(section["time"], "s", "[design] time")
        if not design["time"] > 0.0:
            raise ParameterError(f"[design] time = {quoted(section['time'])} must be above zero")
    return design


def _require_of_use(kind: str, section: Mapping[str, Any]) -> None:
    """Refuse what a design has no use for."""
    if "levels" in section and kind not in _WITH_LEVELS:
        raise ParameterError(
            f"[design] levels: {kind!r} has none to choose"
            + (f", it steps on {LEVELS}" if kind == "morris" else "")
            + ": leave them out"
        )
    if "cases_per_level" in section and kind != SUBSET:
        raise ParameterError(
            f"[design] cases_per_level: {kind!r} has no levels to fill, {SUBSET!r} has: leave it "
            "out"
        )
    if "time" in section and kind in SOUGHT:
        raise ParameterError(f"[design] time: the budget of {kind!r} is its 'cases': leave it out")
    if "cases" in section and kind in SPANNED:
        raise ParameterError(
            f"[design] cases: {kind!r} lists its cases by quantities and levels: leave them out"
        )
