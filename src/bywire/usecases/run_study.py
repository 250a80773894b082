"""A study: a bench for many values of what varies."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from bywire.usecases.asks import BenchChanges, Cases, ClusterAddress, EngineName, Workers
from bywire.usecases.declare import NOTHING, Ask, Command, Form, use_case

if TYPE_CHECKING:
    from bywire.api.study_run import StudyRun
    from bywire.core.typing import Progress

StudyFile = Annotated[
    str | Path, Ask("Study file (TOML).", "Study", metavar="FILE", offered=("studies",))
]
FolderOfStudy = Annotated[
    str | Path | None,
    Ask("Folder of the study; by default named as the file.", is_folder=True),
]


def _read(study: Path, overrides: Mapping[str, str], cases: int | None) -> None:
    from bywire.core.arguments import whole_number
    from bywire.studies.designs import MOST
    from bywire.studies.study_file import read_study

    if cases is not None:
        whole_number("cases", cases, 1, MOST)

    read_study(study, overrides)


def _require_study_file(study: Path, **others: Any) -> None:
    from bywire.studies.meant_study import require_study_file

    del others
    require_study_file(study)


def _named_as_file(study: Path, **others: Any) -> Path:
    del others
    return Path(study.stem)


@use_case(
    Command("study run", before=_require_study_file, default_folder=_named_as_file),
    form=Form(
        "Run the study",
        "Run, or go on",
        "study",
        name="study",
        fields=("study", "cases", "set"),
        is_listed=False,
        is_kept=True,
    ),
    check=_read,
)
def run_study(
    study: StudyFile,
    out: FolderOfStudy = None,
    overrides: BenchChanges = NOTHING,
    *,
    cases: Cases = None,
    workers: Workers = None,
    cluster: ClusterAddress = "",
    engine: EngineName = "auto",
    progress: "Progress | None" = None,
) -> "StudyRun":
    """Run a bench for many values of what varies: probabilities, spread, what drives them.

    What its folder holds is not computed again, so that the same call goes on with a study that
    was interrupted or killed.

    Parameters
    ----------
    study
        Study file; see ``docs/studies.md``.
    out
        Its folder; by default the name of the file, without its ending, in the current folder.
    overrides
        Changes of the bench, as texts with units; kept with the study.
    cases
        Cases in place of the file's, up to 10 million. More than were asked for so far extend what
        is there, fewer take back those that are not computed. Where the folder has more than the
        file asks for, all are judged.
    workers
        Processes; by default one a core where the work is worth their start.
    cluster
        Address of a Dask scheduler that computes instead.
    engine
        What computes; ``auto`` is what the bench says. ``cuda``: a graphics processor.
    progress
        Called with a label and the finished share, 0 to 1.

    Returns
    -------
    StudyRun
        Probabilities of the requirements with intervals, the spread of key figures in SI units,
        what drives them, the worst cases.

    Raises
    ------
    InputError
        For a study file that does not fit, and a folder that holds another study.
    RunError
        When the bench itself fails, or workers are lost. A case that fails is a case without a
        result.
    KeyboardInterrupt
        When interrupted; finished chunks stay.
    """
    from bywire.api.study_run import completed, with_engine
    from bywire.studies.meant_study import require_study_file
    from bywire.studies.store import Origin, StudyStore, with_cases
    from bywire.studies.study_file import read_study

    source = Path(study)
    require_study_file(source)
    store = StudyStore(Path(out) if out is not None else Path(source.stem))
    plan = with_cases(with_engine(engine, read_study(source, overrides)), store, cases)
    return completed(Origin(source, overrides), plan, store, workers, cluster, progress)
