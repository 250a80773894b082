"""Options of the commands that go from measurements to parameters."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from bywire.cli.options import (
    BenchChanges,
    CaseName,
    Changes,
    Inputs,
    JsonFlag,
    Map,
    OutFolder,
    Parameters,
    changes,
    execute,
    named,
)

# What methods of any bench take.
_ANY_BENCH = "Methods of any bench"
TestBench = Annotated[
    Path | None,
    typer.Option(
        "--bench", help="Bench file (TOML), or an experiment's name.", rich_help_panel=_ANY_BENCH
    ),
]
NoisyOutputs = Annotated[
    list[str] | None,
    typer.Option("--output", metavar="SIGNAL[=NOISE]", rich_help_panel=_ANY_BENCH,
                 help="Output of the model that is measured, e.g. 'p_mc=0.02 bar'."),
]  # fmt: skip
Unknowns = Annotated[
    list[str] | None,
    typer.Option("--unknown", metavar="NAME[=LOW..HIGH]", rich_help_panel=_ANY_BENCH,
                 help="What is searched, e.g. 'motor.R_m=0.1..1 ohm', offset.i_meas."),
]  # fmt: skip
Priors = Annotated[
    list[str] | None,
    typer.Option("--prior", metavar="NAME=VALUE+-DEV", rich_help_panel=_ANY_BENCH,
                 help="What is known of it, e.g. 'motor.R_m=0.35 +- 0.02 ohm'."),
]  # fmt: skip
States = Annotated[
    list[str] | None,
    typer.Option("--estimate-start", metavar="STATE", rich_help_panel=_ANY_BENCH,
                 help="State whose initial value is unknown, e.g. omega."),
]  # fmt: skip
Loss = Annotated[
    str,
    typer.Option(rich_help_panel=_ANY_BENCH, help="linear, soft_l1, huber or cauchy."),
]
Holdout = Annotated[
    Path | None,
    typer.Option(rich_help_panel=_ANY_BENCH, help="Measurement that is not fitted: validation."),
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
        typer.Option("--option", metavar="KEY=VALUE", help="Its options: 'bywire list METHOD'."),
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
    bench: TestBench = None,
    input_: Inputs = None,
    output: NoisyOutputs = None,
    unknown: Unknowns = None,
    prior: Priors = None,
    start: States = None,
    case: CaseName = "",
    loss: Loss = "",
    holdout: Holdout = None,
    out: OutFolder = None,
    json: JsonFlag = False,
) -> None:
    """Identify parameters with their confidence from measurements; status 1 if a check fails."""
    from bywire.cli.measured_bench import OnBench
    from bywire.cli.method_choice import Wanted

    on_bench = OnBench(
        bench, changes(input_, "--input"), named(output, "--output"), named(unknown, "--unknown"),
        changes(prior, "--prior"), start or [], case, holdout, loss,
    )  # fmt: skip
    options = changes([*(option or []), *([f"loss={loss}"] if loss else [])], "--option")
    wanted = Wanted(
        measurements or [], map_, parameters, changes(set_), options,
        starts or (16 if study is None else 1), seed, synthetic, study, on_bench,
    )  # fmt: skip
    raise typer.Exit(execute("identify_command", method, wanted, out, json))


def replay(
    measurement: Annotated[Path, typer.Argument(help="Measurement file.", show_default=False)],
    bench: Annotated[Path, typer.Option(help="Bench file (TOML), or an experiment's name.")],
    map_: Map = None,
    set_: BenchChanges = None,
    input_: Inputs = None,
    output: Annotated[
        list[str] | None,
        typer.Option("--output", metavar="SIGNAL", help="What is compared; by default all."),
    ] = None,
    case: CaseName = "",
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
