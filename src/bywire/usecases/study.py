"""Studies: run, resume, report, surrogates, and sizing studies."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from bywire.core.errors import UnknownNameError, unknown_name
from bywire.core.libraries import on_one_thread
from bywire.usecases.asks import (
    STUDY_FOLDER,
    BenchChanges,
    Cases,
    ClusterAddress,
    EngineName,
    ParameterSetName,
    StudyFolder,
    Workers,
    require_study_folder,
)
from bywire.usecases.declare import NOTHING, Ask, Command, Form, use_case

if TYPE_CHECKING:
    from bywire.api.study import AskedStudy, StudyResult
    from bywire.api.study_run import StudyRun
    from bywire.api.study_surrogate import StudySurrogates
    from bywire.core.typing import Progress

StudyFile = Annotated[
    str | Path, Ask("Study file (TOML).", "Study", metavar="FILE", offered=("studies",))
]
FolderOfStudy = Annotated[
    str | Path | None,
    Ask("Study folder. Default: the study file's name without its suffix.", is_folder=True),
]


def _read_file(study: Path, overrides: Mapping[str, str], cases: int | None) -> None:
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
    check=_read_file,
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
    """Run a bench many times with varied quantities to estimate probabilities and influences.

    bywire does not recompute results that are already in the study folder. Therefore, the same call
    continues a study that was interrupted or killed.

    Parameters
    ----------
    study
        Study file (see ``docs/studies.md``).
    out
        Study folder. Default: the file's name without its suffix, in the current folder.
    overrides
        Changes to the bench, as strings with units. bywire saves them with the study.
    cases
        Number of cases, up to 10 million. Overrides the study file. A larger number than before
        extends the study. A smaller number drops cases that are not computed yet. If the folder
        contains more cases than the file requests, bywire uses all of them.
    workers
        Number of processes. Default: one per core, if the work justifies starting them.
    cluster
        Address of a Dask scheduler that runs the cases.
    engine
        Simulation engine: ``auto`` for the bench's engine, or ``cuda`` for a GPU.
    progress
        Called with a label and the completed fraction, 0 to 1.

    Returns
    -------
    StudyRun
        Probabilities that requirements are met, with intervals, the spread of key figures in SI
        units, the main influences, and the worst cases.

    Raises
    ------
    InputError
        If the study file is invalid, or the folder contains another study.
    RunError
        If the nominal bench fails, or workers are lost. A failed case only lacks a result.
    KeyboardInterrupt
        If interrupted. Finished chunks stay in the folder.
    """
    from bywire.api.study_run import completed, with_engine
    from bywire.studies.meant_study import require_study_file
    from bywire.studies.stated_error import with_step
    from bywire.studies.store import Origin, StudyStore, with_cases
    from bywire.studies.study_file import read_study

    source = Path(study)
    require_study_file(source)
    store = StudyStore(Path(out) if out is not None else Path(source.stem))
    plan = with_step(with_engine(engine, read_study(source, overrides)), store, progress)
    plan = with_cases(plan, store, cases)
    return completed(Origin(source, overrides), plan, store, workers, cluster, progress)


# --- Continuation of a study: interrupted, killed, or with more cases


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
        Study folder.
    cases
        New total number of cases. A larger number extends the study with points of the same
        sequence. A smaller number drops cases that are not computed yet.
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
        If interrupted. Finished chunks stay in the folder.
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


# --- Progress and results of a study so far


@use_case(
    Command(
        "study report",
        "Check a study's results so far against the requirements in its file, and write a report.",
        **STUDY_FOLDER,
    ),
    Command("study status", before=require_study_folder, writes=""),
)
def study_report(folder: StudyFolder) -> "StudyRun":
    """Show a study's progress and results so far without writing anything.

    bywire uses the requirements that the study file contains now.

    Parameters
    ----------
    folder
        Study folder.

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


# --- Polynomial surrogates of key figures between the cases of a study

KeyFigures = Annotated[
    str | Sequence[str],
    Ask("Key figure to estimate. Default: those with requirements.", name="kpi", metavar="NAME"),
]
Values = Annotated[
    Mapping[str, Any],
    Ask("Value at which to estimate, e.g. motor.R_m=0.4ohm.", metavar="KEY=VALUE"),
]


@use_case(Command("study surrogate", before=require_study_folder, writes=""))
def study_surrogates(
    folder: StudyFolder,
    kpis: KeyFigures = (),
    at: Values = NOTHING,
) -> "StudySurrogates":
    """Fit polynomials to a study's key figures to predict values between its cases.

    Parameters
    ----------
    folder
        Study folder.
    kpis
        One or more key figures. Default: those with a requirement. If none has one, all.
    at
        Values of varied quantities at which to estimate, as SI numbers, strings with units, or
        changes such as ``"+5 %"`` relative to the bench's value. All other quantities have the
        bench's value.

    Returns
    -------
    StudySurrogates
        Each surrogate with its error in the key figure's unit. ``.surrogates["overshoot"]`` is a
        function of numbers or arrays [SI].

    Raises
    ------
    InputError
        If the folder contains no study or too few cases, a name is unknown, or a value is outside
        the range of the cases or between the values of a discrete quantity. Also if the study's
        design allows no estimates between its points, or structural choices vary.
    """
    from bywire.api.study_run import kept_study
    from bywire.api.study_surrogate import StudySurrogates
    from bywire.api.study_tables import shown_figures
    from bywire.bench.changes import share_of
    from bywire.core.errors import ParameterError, unknown_name
    from bywire.core.values import number
    from bywire.studies.surrogate import Surrogate, require_fittable, surrogate_of

    report = kept_study(folder)
    require_fittable(report.plan)  # before values are read: those of a choice are not numbers
    findings = report.findings
    quantities = {v.name: v for v in report.plan.varied}
    values: dict[str, float] = {}
    for name, text in at.items():
        if name not in quantities:
            raise unknown_name("quantity of the study", name, quantities)
        share = share_of(text)
        change = (1.0 + share) * quantities[name].nominal if share is not None else text
        values[name] = number(change, quantities[name].unit or "1", name)
    surrogates: dict[str, Surrogate] = {}
    refused: dict[str, str] = {}
    wanted = [kpis] if isinstance(kpis, str) else kpis
    required = [each.figure for each in report.plan.demands]
    for kpi in wanted or shown_figures(findings) or required:
        try:
            surrogates[kpi] = surrogate_of(findings, kpi)
        except ParameterError as error:
            refused[kpi] = str(error)
    if not surrogates:
        why = "; ".join(dict.fromkeys(refused.values()))
        raise ParameterError(why or f"{folder}: no case is computed yet", name=str(folder))
    return StudySurrogates(report, surrogates, values, refused)


# --- Sizing study: comparison of brake designs under the same demands

SizingName = Annotated[
    str, Ask("Sizing study (see 'bywire list studies').", "Sizing study", known=("studies",))
]
SizingChanges = Annotated[
    Mapping[str, Any],
    Ask(
        "Change an option or a parameter, e.g. t_90=120ms.",
        "Changes",
        name="set",
        metavar="KEY=VALUE",
    ),
]


def _read_sizing(name: str, parameters: str, overrides: Mapping[str, Any]) -> "AskedStudy":
    from bywire.api.study import asked_study

    return asked_study(name, parameters, overrides)


def _require_sizing(name: str, **others: Any) -> None:
    """Reject an unknown sizing study, and suggest the study file that the user may have meant."""
    from bywire.core.brake import loaded_files
    from bywire.studies.meant_study import meant_study
    from bywire.synthesis.study import STUDIES

    del others
    if STUDIES.get(name) is not None:
        return
    file = meant_study(Path(name))
    if file is not None:
        raise UnknownNameError(
            f"unknown sizing study {name!r}. To run the study file {file}, type 'bywire study run "
            f"{file}'",
            name="sizing study",
            value=name,
            valid=f"bywire study run {file}",
        )
    if loaded_files():
        raise STUDIES.unknown(name)  # explains how a user's brake declares a sizing study
    error = str(unknown_name("sizing study", name, STUDIES.all()))
    more = (
        ". To load your own brake, add --system PATH. To run a study file, type 'bywire study run "
        "FILE'"
    )
    raise UnknownNameError(
        error if error.endswith("?") else error + more, name="sizing study", value=name
    )


@use_case(
    Command("study size", before=_require_sizing),
    form=Form("Sizing study", "Compare designs", "name", name="size"),
    check=_read_sizing,
)
@on_one_thread()
def study(
    name: SizingName,
    parameters: ParameterSetName = "",
    overrides: SizingChanges = NOTHING,
    *,
    progress: "Progress | None" = None,
) -> "StudyResult":
    """Compare brake designs under the same demands to find the best one, its limits and its cost.

    Parameters
    ----------
    name
        Name of the study.
    parameters
        Parameter set. Default: the main set of the study's brake.
    overrides
        Changes as SI numbers or strings with units. Names with a dot are the brake's parameters.
        All others are the study's options.
    progress
        Called with a label and the completed fraction, 0 to 1.

    Returns
    -------
    StudyResult
        All designs with their figures in SI units, the best design, and its limits.

    Raises
    ------
    InputError
        If a name is unknown, a value is out of range, or a change has no effect.
    """
    from bywire.api.study import StudyResult
    from bywire.core.typing import silent

    definition, named, par, options = _read_sizing(name, parameters, overrides)
    findings = definition.compute(par, options, progress or silent)
    return StudyResult(definition, named, par, options, findings)
