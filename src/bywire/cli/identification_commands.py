"""Options of the commands that go from measurements to parameters."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from bywire.cli.options import Changes, JsonFlag, OutFolder, Parameters, changes, execute

Map = Annotated[
    Path | None, typer.Option("--map", metavar="PATH", help="What the columns mean (TOML).")
]


def identify(
    method: Annotated[str, typer.Argument(help="Method, see 'bywire list'.", show_default=False)],
    measurements: Annotated[
        list[Path] | None,
        typer.Argument(metavar="[MEASUREMENT]...", help="Measurement files.", show_default=False),
    ] = None,
    map_: Map = None,
    parameters: Parameters = "",
    set_: Changes = None,
    option: Annotated[
        list[str] | None,
        typer.Option("--option", metavar="KEY=VALUE", help="Change an option of the method."),
    ] = None,
    starts: Annotated[
        int | None, typer.Option(help="Starts of the search: 16; with --study 1.", min=1)
    ] = None,
    seed: Annotated[int, typer.Option(help="Seed of the starts, or the study's first.", min=0)] = 1,
    synthetic: Annotated[
        int | None,
        typer.Option(metavar="SEED", help="Identify a simulated measurement instead.", min=0),
    ] = None,
    study: Annotated[
        int | None,
        typer.Option(metavar="COUNT", help="Try the method on many simulated ones.", min=2),
    ] = None,
    out: OutFolder = None,
    json: JsonFlag = False,
) -> None:
    """Identify parameters with their confidence from measurements; status 1 if a check fails."""
    from bywire.cli.identify_command import Wanted

    wanted = Wanted(
        measurements or [], map_, parameters, changes(set_), changes(option, "--option"),
        starts or (16 if study is None else 1), seed, synthetic, study,
    )  # fmt: skip
    raise typer.Exit(execute("identify_command", method, wanted, out, json))


def replay(
    measurement: Annotated[Path, typer.Argument(help="Measurement file.", show_default=False)],
    bench: Annotated[Path, typer.Option(help="Bench file (TOML), or an experiment's name.")],
    map_: Map = None,
    set_: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="KEY=VALUE", help="Change the bench, e.g. motor.R_m=0.4ohm."),
    ] = None,
    input_: Annotated[
        list[str] | None,
        typer.Option("--input", metavar="STIMULUS=SIGNAL", help="What drives the model."),
    ] = None,
    output: Annotated[
        list[str] | None,
        typer.Option("--output", metavar="SIGNAL", help="What is compared; by default all."),
    ] = None,
    case: Annotated[str, typer.Option(help="Run of the experiment; the first by default.")] = "",
    tolerance: Annotated[
        list[str] | None,
        typer.Option(help="Tolerance, e.g. 'nrmse <= 5 %', 'p_mc.max_error <= 2 bar'."),
    ] = None,
    segments: Annotated[
        str, typer.Option(help="Judge stretches: auto (steps and holds), or a TOML file.")
    ] = "",
    track: Annotated[
        list[str] | None,
        typer.Option(help="Track a drifting parameter as well, e.g. mu_B."),
    ] = None,
    out: OutFolder = None,
    json: JsonFlag = False,
) -> None:
    """Drive the model with a measured demand and compare; status 1 if a tolerance is missed."""
    from bywire.cli.replay_command import Wanted

    wanted = Wanted(
        measurement, bench, map_, changes(set_), changes(input_, "--input"), output or [], case,
        tolerance or [], segments, track or [],
    )  # fmt: skip
    raise typer.Exit(execute("replay_command", wanted, out, json))
