"""How many cases a study is asked for, beside what its file says and its folder has."""

from __future__ import annotations

from dataclasses import replace

from bywire.core.arguments import whole_number
from bywire.core.errors import ParameterError
from bywire.studies.plan import StudyPlan
from bywire.studies.points import MOST, SPANNED
from bywire.studies.store import StudyStore


def with_cases(plan: StudyPlan, store: StudyStore, cases: int | None) -> StudyPlan:
    """Return the plan with so many cases, and with all that its folder was asked for.

    Parameters
    ----------
    plan
        The study as its file says.
    store
        Its folder.
    cases
        Cases asked for; None for as many as the file and the folder say. Fewer than the folder was
        asked for take back those that are not computed.

    Raises
    ------
    ParameterError
        For fewer than are computed, too few, too many, and where the design says how many there
        are.
    """
    if cases is not None:
        cases = whole_number("cases", cases, 1, MOST)
    if plan.design in SPANNED:
        if cases is not None:
            require_extensible(plan, cases)
        return plan
    if plan.is_sampled or plan.sought is not None:
        asked, computed = store.asked_and_computed(plan)
        if cases is not None and cases < computed:
            raise ParameterError(
                f"cases = {cases}: {store.folder} has {computed} already, and none are taken off: "
                "name more of them, or another folder"
            )
        extended = replace(plan, cases=max(plan.cases, asked) if cases is None else cases)
        if extended.sought is not None:
            extended.sought.require_budget()
        return extended
    given = plan if cases is None else replace(plan, cases=cases)
    given.points  # noqa: B018 - refuses too few before anything runs
    return given


def require_extensible(plan: StudyPlan, cases: int) -> None:
    """Refuse to add cases to a design that has its own.

    Raises
    ------
    ParameterError
        When it lists them, or they belong together in groups.
    """
    if plan.is_sampled or plan.sought is not None:
        return
    why = (
        "it lists them by quantities and levels"
        if plan.design in SPANNED
        else "its groups belong together"
    )
    raise ParameterError(
        f"cases = {cases}: none are added to a study of {plan.design!r}, for {why}: change the "
        "study file, and run it into another folder"
    )
