"""Many runs of a bench: probabilities of its requirements, and what drives its key figures."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType

from bywire.api.study_figures import load_drawing
from bywire.api.study_run import StudyRun
from bywire.bench import running
from bywire.bench.requirements import status_of
from bywire.bench.result import Result
from bywire.bench.running import Progress
from bywire.core.brake import loaded_files
from bywire.core.callers import is_command_line
from bywire.core.errors import FileError, InputError
from bywire.core.field_notes import field_notes
from bywire.core.typing import silent
from bywire.report.answer import use_case
from bywire.studies.designs import SPANNED, WORST
from bywire.studies.findings import Findings
from bywire.studies.meant_study import require_study_file
from bywire.studies.plan import StudyPlan
from bywire.studies.rare_failures import rare_failures
from bywire.studies.running import complete
from bywire.studies.store import Origin, StudyStore, require_extensible, with_cases
from bywire.studies.study_file import read_study
from bywire.studies.worst_case import worst_cases


@use_case
def run_study(
    study: str | Path,
    out: str | Path | None = None,
    overrides: Mapping[str, str] = MappingProxyType({}),
    *,
    cases: int | None = None,
    workers: int | None = None,
    cluster: str = "",
    engine: str = "auto",
    progress: Progress | None = None,
) -> StudyRun:
    """Run a study: a bench for many values of what varies.

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
    source = Path(study)
    require_study_file(source)
    store = StudyStore(Path(out) if out is not None else Path(source.stem))
    plan = with_cases(_by(engine, read_study(source, overrides)), store, cases)
    return _completed(Origin(source, overrides), plan, store, workers, cluster, progress)


def _completed(
    origin: Origin,
    plan: StudyPlan,
    store: StudyStore,
    workers: int | None,
    cluster: str,
    progress: Progress | None,
) -> StudyRun:
    """Return a study with all of its cases, those that were missing computed."""

    def ready() -> None:
        if is_command_line():  # its report is drawn next; a program may want no figure
            load_drawing()
            field_notes(type(plan.bench.par))

    try:
        completed = complete(
            plan,
            store,
            origin,
            workers=workers,
            cluster=cluster,
            progress=progress or silent,
            meanwhile=ready,
        )
    except KeyboardInterrupt:
        of = "" if plan.sought is not None else f" of {plan.chunks}"
        raise KeyboardInterrupt(
            f"{len(store.finished())}{of} chunks are kept: {store.resume_command}"
        ) from None
    return replace(_run_of(plan, store, completed.nominal), damaged=completed.damaged)


@use_case
def resume_study(
    folder: str | Path,
    *,
    cases: int | None = None,
    workers: int | None = None,
    cluster: str = "",
    engine: str = "auto",
    progress: Progress | None = None,
) -> StudyRun:
    """Go on with the study of a folder, where it was interrupted or with more cases.

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
    store = StudyStore(Path(folder))
    plan, origin = _kept(store)
    plan = _by(engine, plan)
    if cases is not None:
        require_extensible(plan, cases)
        plan = with_cases(plan, store, cases)
    return _completed(origin, plan, store, workers, cluster, progress)


@use_case
def study_report(folder: str | Path) -> StudyRun:
    """Return what the study of a folder shows so far; nothing is computed but the bench itself.

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
    return kept_study(folder)


def kept_study(folder: str | Path) -> StudyRun:
    """Return what `study_report` does, without warning of anything: for what is made of it."""
    store = StudyStore(Path(folder))
    plan, _ = _kept(store)
    store.require(plan)
    return _run_of(plan, store, running.run(plan.bench, estimate_error=True))


def _kept(store: StudyStore) -> tuple[StudyPlan, Origin]:
    """Return the study of a folder, with as many cases as were asked for, and its origin."""
    said = store.record()
    origin = Origin(Path(said["source"]), said["set"])
    if not origin.file.is_file():
        raise FileError(
            f"the study file {origin.file} of {store.folder} is gone: run it from where it is now, "
            f"bywire study run FILE --out {store.folder}"
        )
    try:
        plan = read_study(origin.file, origin.overrides)
    except InputError as error:
        unloaded = [path for path in said["systems"] if path not in loaded_files()]
        if not unloaded:
            raise
        raise type(error)(
            f"{error}; the study was run with --system {' --system '.join(unloaded)}"
        ) from None
    is_listed = plan.design in SPANNED
    return (plan if is_listed else replace(plan, cases=int(said["cases"]))), origin


def _by(engine: str, plan: StudyPlan) -> StudyPlan:
    """Return the plan computed by an engine; its cases are the same by whichever."""
    return plan if engine == "auto" else replace(plan, bench=replace(plan.bench, engine=engine))


def _run_of(plan: StudyPlan, store: StudyStore, nominal: Result) -> StudyRun:
    if plan.design == WORST:
        searches, cases = worst_cases(plan, store)
        findings = Findings(plan, cases, nominal.kpis, searches=searches)
        is_whole = all(each.state != "unfinished" for each in searches)
    elif plan.sought is not None:
        rare, cases = rare_failures(plan, store)
        findings = Findings(plan, cases, nominal.kpis, rare)
        is_whole = all(each.failure.state != "unfinished" for each in rare)
    else:
        findings = Findings(plan, store.read(plan.chunks), nominal.kpis)
        is_whole = len(findings.cases) == plan.total
    judged = status_of(findings.judgments) if findings.spreads else "failed"
    status = judged if is_whole else "unfinished"
    return StudyRun(plan, store.folder, findings, nominal, status)
