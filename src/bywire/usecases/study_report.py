"""Progress and results so far of a study."""

from typing import TYPE_CHECKING

from bywire.usecases.asks import STUDY_FOLDER, StudyFolder, require_study_folder
from bywire.usecases.declare import Command, use_case

if TYPE_CHECKING:
    from bywire.api.study_run import StudyRun


@use_case(
    Command(
        "study report",
        "Judge a study's results so far by the requirements in its file, and write the report.",
        **STUDY_FOLDER,
    ),
    Command("study status", before=require_study_folder, writes=""),
)
def study_report(folder: StudyFolder) -> "StudyRun":
    """Show a study's progress and results so far without writing anything.

    bywire uses the requirements that are now in the study file.

    Parameters
    ----------
    folder
        Folder of the study.

    Returns
    -------
    StudyRun
        See `run_study`. Values are in SI units.

    Raises
    ------
    InputError
        If the folder contains no study, or the study file is missing or has changed.
    """
    from bywire.api.study_run import kept_study

    return kept_study(folder)
