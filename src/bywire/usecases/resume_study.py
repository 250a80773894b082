"""A study that goes on: interrupted, killed, or with more cases."""

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
        "Add cases to a study, by points of the same sequence.",
        required={"cases": "Cases altogether."},
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
    """Go on with a study that was interrupted or killed.

    Parameters
    ----------
    folder
        Folder of the study.
    cases
        Cases in place of those that were asked for so far; more of them extend the study by points
        of the same sequence, fewer take back what is not computed.
    workers, cluster, engine, progress
        See `run_study`.

    Returns
    -------
    StudyRun
        See `run_study`; values in SI units.

    Raises
    ------
    InputError
        When the folder holds no study, its file is gone, or says something else by now.
    RunError
        When workers are lost.
    KeyboardInterrupt
        When interrupted; finished chunks stay.
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
