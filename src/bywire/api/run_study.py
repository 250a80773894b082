"""Many runs of a bench: probabilities of its requirements, and what drives its key figures."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from bywire.api.study_figures import load_drawing
from bywire.api.study_run import StudyRun
from bywire.bench import running
from bywire.bench.requirements import status_of
from bywire.bench.running import Progress, Result
from bywire.core.brake import loaded_files
from bywire.core.callers import is_command_line
from bywire.core.errors import FileError, InputError
from bywire.core.parameters import field_notes
from bywire.core.typing import silent
from bywire.studies.designs import SPANNED, WORST
from bywire.studies.findings import Findings
from bywire.studies.plan import StudyPlan
from bywire.studies.rare_failures import rare_failures
from bywire.studies.running import complete
from bywire.studies.store import Origin, StudyStore
from bywire.studies.study_file import read_study
from bywire.studies.worst_case import worst_cases


def completed(
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


def kept_study(folder: str | Path) -> StudyRun:
    """Return what `study_report` does, without warning of anything: for what is made of it."""
    store = StudyStore(Path(folder))
    plan, _ = kept_plan(store)
    store.require(plan)
    return _run_of(plan, store, running.run(plan.bench, estimate_error=True))


def kept_plan(store: StudyStore) -> tuple[StudyPlan, Origin]:
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
        raise error.reworded(
            f"{error}; the study was run with {' '.join(map(_loaded_by, unloaded))}"
        ) from None
    is_listed = plan.design in SPANNED
    return (plan if is_listed else replace(plan, cases=int(said["cases"]))), origin


def with_engine(engine: str, plan: StudyPlan) -> StudyPlan:
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


def _loaded_by(path: str) -> str:
    """Return how a reader loads a brake from a file."""
    return f"--system {path}" if is_command_line() else f'bywire.load_system("{path}")'
