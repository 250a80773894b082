"""What a study shows so far."""

from typing import TYPE_CHECKING

from bywire.usecases.asks import STUDY_FOLDER, StudyFolder, require_study_folder
from bywire.usecases.declare import Command, use_case

if TYPE_CHECKING:
    from bywire.api.study_run import StudyRun


@use_case(
    Command(
        "study report",
        "Judge what a study has so far, by the requirements of its file, and write its report.",
        **STUDY_FOLDER,
    ),
    Command("study status", before=require_study_folder, writes=""),
)
def study_report(folder: StudyFolder) -> "StudyRun":
    """Say how far a study is, and what it shows so far; nothing is written.

    Requirements are those that its file says now.

    Parameters
    ----------
    folder
        Folder of the study.

    Returns
    -------
    StudyRun
        See `run_study`; values in SI units.

    Raises
    ------
    InputError
        When the folder holds no study, its file is gone, or says something else by now.
    """
    from bywire.api.study_run import kept_study

    return kept_study(folder)
