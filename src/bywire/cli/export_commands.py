"""Options of the commands that take a bench's parts out of it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from bywire.cli.options import BenchChanges, BenchFile, JsonFlag, changes
from bywire.cli.output_folder import folder
from bywire.cli.show import show

export_app = typer.Typer(
    no_args_is_help=True, help="Write parts of a bench in the form that other tools take."
)

ExportFolder = Annotated[
    Path,
    typer.Option(
        "--out", help="Folder of the export.", parser=folder, metavar="PATH", show_default=False
    ),
]
Precision = Annotated[str, typer.Option(help="Numbers of the C: double, or single.")]
RunLabel = Annotated[
    str, typer.Option("--case", help="Run of the experiment; needed where there are several.")
]


@export_app.command("controller")
def export_controller_command(
    bench: BenchFile,
    out: ExportFolder,
    precision: Precision = "double",
    vectors: Annotated[int, typer.Option(help="Test vectors of each task.")] = 200,
    check: Annotated[
        bool,
        typer.Option(
            "--check",
            help="Run it here and on emulated Cortex-M3, M4F and M7, in both "
            "precisions; exit status 1 where a bit differs.",
        ),
    ] = False,
    dbc: Annotated[
        bool, typer.Option("--dbc", help="Describe its memory for a CAN bus, too.")
    ] = False,
    name: Annotated[
        str,
        typer.Option(
            help="What files and symbols begin with, so that several ECUs link into one program.",
            show_default="the model's name",
        ),
    ] = "",
    set_: BenchChanges = None,
    json: JsonFlag = False,
) -> None:
    """Write the ECU as readable C99 with parameters, test vectors and a harness."""
    from bywire.api.export_controller import export_controller
    from bywire.bench.bench_file import read

    show(
        lambda _: export_controller(
            read(bench, changes(set_)),
            out,
            precision=precision,
            vectors=vectors,
            check=check,
            dbc=dbc,
            name=name,
        ),
        None,
        json,
    )


@export_app.command("fmu")
def export_fmu_command(
    bench: BenchFile,
    out: ExportFolder,
    part: Annotated[
        str,
        typer.Option(help="brake, plant or ecu.", show_default="brake; plant for model-exchange"),
    ] = "",
    kind: Annotated[
        str, typer.Option(help="co-simulation, or model-exchange of the plant.")
    ] = "co-simulation",
    fmi: Annotated[int, typer.Option(help="Version of the interface: 2 or 3.")] = 2,
    case: RunLabel = "",
    target: Annotated[
        list[str] | None,
        typer.Option(help="System, e.g. linux64 or win64; may be given several times."),
    ] = None,
    set_: BenchChanges = None,
    json: JsonFlag = False,
) -> None:
    """Write a functional mock-up unit for co-simulation, or model exchange."""
    from bywire.api.export_fmu import export_fmu

    show(
        lambda progress: export_fmu(
            bench,
            out,
            changes(set_),
            part=part,
            kind=kind,
            fmi=fmi,
            case=case,
            targets=target or (),
            progress=progress,
        ),
        None,
        json,
    )


@export_app.command("wasm")
def export_wasm_command(
    bench: BenchFile,
    out: ExportFolder,
    case: RunLabel = "",
    set_: BenchChanges = None,
    json: JsonFlag = False,
) -> None:
    """Write a run as WebAssembly with a loader: parameters in, recording out."""
    from bywire.api.export_wasm import export_wasm

    show(lambda _: export_wasm(bench, out, changes(set_), case=case), None, json)
