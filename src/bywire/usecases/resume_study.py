"""Continuation of a study that was interrupted or killed, or that needs more cases."""

from typing import TYPE_CHECKING

from bywire.usecases.asks import (
    STUDY_FOLDER,
    Cases,
    ClusterAddress,
    EngineName,
    StudyFolder,
    Workers,
)
from bywire.usecases.declare import Command, use_case

if TYPE_CHECKING:
    from bywire.api.study_run import StudyRun
    from bywire.core.typing import Progress


@use_case(
    Command("study resume", without=("cases",), **STUDY_FOLDER),
    Command(
        "study extend",
        "Add cases to a study, continuing its sequence of points.",
        required={"cases": "Total number of cases."},
        **STUDY_FOLDER,
    ),
)
def resume_study(
    folder: StudyFolder,
    *,
    cases: Cases = None,
    workers: Workers = None,
    cluster: ClusterAddress = "",
    engine: EngineName = "auto",
    progress: "Progress | None" = None,
) -> "StudyRun":
    """Continue a study that was interrupted or killed.

    Parameters
    ----------
    folder
        Folder of the study.
    cases
        Number of cases, which replaces the present one. A larger number extends the study with
        points of the same sequence. A smaller number drops cases that are not yet computed.
    workers, cluster, engine, progress
        See `run_study`.

    Returns
    -------
    StudyRun
        See `run_study`. Values are in SI units.

    Raises
    ------
    InputError
        If the folder contains no study, or the study file is missing or has changed.
    RunError
        If workers are lost.
    KeyboardInterrupt
        If interrupted. Finished chunks remain.
    """
    from pathlib import Path

    from bywire.api.study_run import completed, kept_plan, with_engine
    from bywire.studies.store import StudyStore, require_extensible, with_cases

    store = StudyStore(Path(folder))
    plan, origin = kept_plan(store)
    plan = with_engine(engine, plan)
    if cases is not None:
        require_extensible(plan, cases)
        plan = with_cases(plan, store, cases)
    return completed(origin, plan, store, workers, cluster, progress)
