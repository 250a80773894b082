"""The worst cases of a study, one search for each requirement."""

from __future__ import annotations

from typing import TYPE_CHECKING

from bywire.core.typing import Progress, silent
from bywire.studies.computing import Executor
from bywire.studies.plan import StudyPlan
from bywire.studies.sought_cases import RequirementCases, SoughtCases
from bywire.studies.store import StudyStore
from bywire.studies.worst_case import WorstCase, worst_case

if TYPE_CHECKING:
    import pandas as pd


def worst_cases(
    plan: StudyPlan,
    store: StudyStore,
    executor: Executor | None = None,
    progress: Progress = silent,
) -> tuple[tuple[WorstCase, ...], pd.DataFrame]:
    """Return how the search for the worst case of each requirement ended, and all cases.

    Parameters
    ----------
    plan, store
        The study and its folder.
    executor
        Who computes the cases that the folder lacks; None to say what it shows so far.
    progress
        Called with a label and the share of the budget that is used.

    Raises
    ------
    FileError
        When the folder cannot be read or written.
    RunError
        When workers are lost.
    KeyboardInterrupt
        When interrupted.
    """
    with SoughtCases(plan, store, executor, progress) as cases:
        found = tuple(
            worst_case(RequirementCases(cases, k).drawn, len(plan.varied), plan.seed)
            for k in range(len(plan.judged_demands))
        )
    return found, cases.frame
