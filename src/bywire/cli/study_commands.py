"""Options of the commands that run studies of many cases; sizing studies go by their names."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from bywire.cli.options import BenchChanges, JsonFlag, changes
from bywire.cli.output_folder import folder
from bywire.cli.show import show
from bywire.core import option_texts as texts
from bywire.core.errors import ParameterError

_SIZE = "size"
_WRITABLE = "see that you may write there"  # the folder of a study is where its chunks are


class _StudyGroup(TyperGroup):
    """Commands of studies; the name of a sizing study stands for ``size NAME``."""

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:  # types of typer's own click
        """Return the command of the first word; see click."""
        if args and args[0].endswith(".toml"):
            raise ParameterError(f"a study file is run by 'bywire study run {args[0]}'")
        if args and not args[0].startswith("-") and args[0] not in self.commands:
            args = [_SIZE, *args]
        return super().resolve_command(ctx, args)


study_app = typer.Typer(
    cls=_StudyGroup,
    no_args_is_help=True,
    help="Run a study of many cases (run FILE), or compare designs of a brake (NAME).",
)


def _study_folder(folder: Path) -> Path:
    """Return the folder that a command names, before anything is made for it."""
    from bywire.studies.meant_study import require_no_file

    require_no_file(folder)
    return folder


StudyFolder = Annotated[
    Path,
    typer.Argument(
        help="Folder of the study.", metavar="FOLDER", show_default=False, callback=_study_folder
    ),
]
Cases = Annotated[int | None, typer.Option(help=texts.STUDY_CASES)]
Workers = Annotated[
    int | None, typer.Option(help="Processes; one a core by default, where it is worth it.")
]
ClusterAddress = Annotated[
    str, typer.Option("--cluster", metavar="ADDRESS", help="Dask scheduler that computes instead.")
]
EngineName = Annotated[str, typer.Option("--engine", help="What computes, e.g. cuda: a GPU.")]


@study_app.command("run")
def study_run_command(
    study: Annotated[
        Path, typer.Argument(help=texts.STUDY_FILE, metavar="FILE", show_default=False)
    ],
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            help="Folder of the study; by default named as the file.",
            parser=folder,
            metavar="PATH",
        ),
    ] = None,
    overrides: BenchChanges = None,
    cases: Cases = None,
    workers: Workers = None,
    cluster: ClusterAddress = "",
    engine: EngineName = "auto",
    json: JsonFlag = False,
) -> None:
    """Run a bench for many values of what varies: probabilities, spread, what drives them."""
    from bywire.studies.meant_study import require_study_file

    require_study_file(study)  # before a folder is made by its name
    from bywire.api.run_study import run_study

    place = out if out is not None else Path(study.stem)
    show(
        lambda progress: run_study(
            study,
            place,
            changes(overrides),
            cases=cases,
            workers=workers,
            cluster=cluster,
            engine=engine,
            progress=progress,
        ),
        place,
        json,
    )


@study_app.command("resume")
def resume_command(
    place: StudyFolder,
    workers: Workers = None,
    cluster: ClusterAddress = "",
    engine: EngineName = "auto",
    json: JsonFlag = False,
) -> None:
    """Go on with a study that was interrupted or killed."""
    _resumed(place, None, workers, cluster, engine, json)


@study_app.command("extend")
def extend_command(
    place: StudyFolder,
    cases: Annotated[int, typer.Option(help="Cases altogether.", show_default=False)],
    workers: Workers = None,
    cluster: ClusterAddress = "",
    engine: EngineName = "auto",
    json: JsonFlag = False,
) -> None:
    """Add cases to a study, by points of the same sequence."""
    _resumed(place, cases, workers, cluster, engine, json)


@study_app.command("report")
def report_command(place: StudyFolder, json: JsonFlag = False) -> None:
    """Judge what a study has so far, by the requirements of its file, and write its report."""
    from bywire.api.run_study import study_report

    show(lambda _: study_report(place), place, json, _WRITABLE)


@study_app.command("status")
def status_command(place: StudyFolder, json: JsonFlag = False) -> None:
    """Say how far a study is, and what it shows so far; nothing is written."""
    from bywire.api.run_study import study_report

    show(lambda _: study_report(place), None, json)


@study_app.command("surrogate")
def surrogate_command(
    place: StudyFolder,
    kpi: Annotated[
        list[str] | None,
        typer.Option(help="Key figure; by default those of requirements.", metavar="NAME"),
    ] = None,
    at: Annotated[
        list[str] | None,
        typer.Option(
            "--at", help="Tell the figures here, e.g. motor.R_m=0.4ohm.", metavar="KEY=VALUE"
        ),
    ] = None,
    json: JsonFlag = False,
) -> None:
    """Tell key figures between the cases of a study by polynomials, with their error."""
    from bywire.api.study_surrogate import study_surrogates

    show(lambda _: study_surrogates(place, kpi or (), changes(at, "--at")), None, json)


def _resumed(
    place: Path, cases: int | None, workers: int | None, cluster: str, engine: str, as_json: bool
) -> None:
    from bywire.api.run_study import resume_study

    show(
        lambda progress: resume_study(
            place,
            cases=cases,
            workers=workers,
            cluster=cluster,
            engine=engine,
            progress=progress,
        ),
        place,
        as_json,
        _WRITABLE,
    )
