"""Study: a bench run for many values of varied quantities."""

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
    Ask("Folder of the study. Default: the study file's name.", is_folder=True),
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
        "Run or continue",
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
    """Run a bench for many values of varied quantities to find probabilities and influences.

    bywire does not recompute results that are in the study's folder. The same call therefore
    continues a study that was interrupted or killed.

    Parameters
    ----------
    study
        Study file (see ``docs/studies.md``).
    out
        Folder of the study. Default: the file's name without its suffix, in the current folder.
    overrides
        Changes to the bench, as texts with units. They are saved with the study.
    cases
        Number of cases, up to 10 million, which overrides the file's. A larger number than before
        extends the study. A smaller number drops cases that are not yet computed. If the folder
        contains more cases than the file requests, bywire judges all of them.
    workers
        Number of processes. Default: one per core, if the work justifies starting them.
    cluster
        Address of a Dask scheduler that runs the cases.
    engine
        Engine. ``auto`` uses the bench's engine, ``cuda`` a graphics processor.
    progress
        Called with a label and the finished share, 0 to 1.

    Returns
    -------
    StudyRun
        Probabilities of meeting requirements, with intervals, the spread of key figures in SI
        units, the main influences, and the worst cases.

    Raises
    ------
    InputError
        For an invalid study file, and a folder that contains another study.
    RunError
        If the nominal bench fails, or workers are lost. A case that fails only lacks a result.
    KeyboardInterrupt
        If interrupted. Finished chunks remain.
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
