"""The section ``[design]`` of a study file: where it is computed, and how many cases."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import Field

from bywire.core.errors import ParameterError, unknown_name
from bywire.core.quantities import Unit
from bywire.core.section import Section
from bywire.studies.plan import StudyPlan
from bywire.studies.points import MOST, SAMPLED, SPANNED
from bywire.studies.sensitivity_design import LEVELS, SENSITIVITY
from bywire.studies.sought_design import DEFAULT_CASES, SOUGHT, SUBSET

_KINDS = (*SAMPLED, *SPANNED, *SENSITIVITY, *SOUGHT)
_WITH_LEVELS = ("grid", "one-at-a-time")
_Cases = Annotated[int | None, Field(ge=1, le=MOST)]


class DesignSection(Section):
    """The section ``[design]``; what it leaves out is as of a `StudyPlan`."""

    kind: str = StudyPlan.design
    cases: _Cases = None
    seed: Annotated[int | None, Field(ge=0, le=2**63 - 1)] = None
    levels: Annotated[int | None, Field(ge=2, le=1000)] = None
    confidence: Annotated[float | None, Unit("1"), Field(ge=0.5, lt=1)] = None
    cases_per_level: _Cases = None
    time: Annotated[float | None, Unit("s"), Field(gt=0)] = None


def read_design(section: DesignSection) -> dict[str, Any]:
    """Return what the section says, by the fields of a `StudyPlan`.

    Raises
    ------
    InputError
        For what is unknown, and what the kind of design has no use for.
    """
    if section.kind not in _KINDS:
        raise unknown_name("[design] kind", section.kind, _KINDS)
    given = section.given
    _require_of_use(section.kind, given)
    if section.kind in DEFAULT_CASES:
        given.setdefault("cases", DEFAULT_CASES[section.kind])
    return {"design": section.kind} | {key: given[key] for key in given if key != "kind"}


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
