"""A study: a bench run for many values of the varied quantities."""

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
    Ask("Folder of the study; by default named like the file.", is_folder=True),
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
    """Run a bench for many values of varied quantities: probabilities, spread, main influences.

    Results in the study's folder are not computed again. The same call therefore continues a study
    that was interrupted or killed.

    Parameters
    ----------
    study
        Study file; see ``docs/studies.md``.
    out
        Folder of the study; by default the file's name without its ending, in the current folder.
    overrides
        Changes of the bench, as texts with units; kept with the study.
    cases
        Number of cases, in place of the file's, up to 10 million. A number larger than so far
        extends the study, a smaller one drops cases not yet computed. If the folder has more cases
        than the file asks for, all are judged.
    workers
        Processes; by default one per core, if the work justifies their start.
    cluster
        Address of a Dask scheduler that runs the cases.
    engine
        Engine; ``auto`` takes the bench's engine, ``cuda`` a graphics processor.
    progress
        Called with a label and the finished share, 0 to 1.

    Returns
    -------
    StudyRun
        Probabilities of the requirements with intervals, the spread of key figures in SI units,
        the main influences, the worst cases.

    Raises
    ------
    InputError
        For an invalid study file, and a folder that contains another study.
    RunError
        If the nominal bench fails, or workers are lost. A failed case only lacks a result.
    KeyboardInterrupt
        If interrupted; finished chunks stay.
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
