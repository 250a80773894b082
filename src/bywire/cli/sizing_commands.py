"""Options of the commands that choose gains and sizes."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from bywire.cli import completion
from bywire.cli.options import (
    At,
    Changes,
    JsonFlag,
    LoopName,
    OutFolder,
    Parameters,
    Side,
    changes,
)
from bywire.cli.show import show
from bywire.cli.study_names import require_sizing
from bywire.core import option_texts as texts


def study_command(
    name: Annotated[
        str,
        typer.Argument(help=texts.SIZING, show_default=False, autocompletion=completion.SIZING),
    ],
    parameters: Parameters = "",
    set_: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="KEY=VALUE", help=texts.SIZING_CHANGES),
    ] = None,
    out: OutFolder = None,
    json: JsonFlag = False,
) -> None:
    """Compare designs of a brake at equal demands: the best, what limits it, at what price."""
    require_sizing(name)
    from bywire.api.study import study

    show(lambda progress: study(name, parameters, changes(set_), progress=progress), out, json)


def design_command(
    loop: LoopName,
    parameters: Parameters = "",
    at: At = "",
    set_: Changes = None,
    require: Annotated[
        list[str] | None,
        typer.Option(help=texts.DESIGN_REQUIRE),
    ] = None,
    requirements: Annotated[
        Path | None, typer.Option(help="TOML file with a section 'requirements'.")
    ] = None,
    over: Annotated[
        list[str] | None,
        typer.Option(help=texts.DESIGN_OVER),
    ] = None,
    amplitudes: Annotated[str, typer.Option(help=texts.DESIGN_AMPLITUDES)] = "",
    schedule: Annotated[
        bool,
        typer.Option("--schedule", help=texts.DESIGN_SCHEDULE),
    ] = False,
    linear_only: Annotated[bool, typer.Option("--linear-only", help=texts.DESIGN_LINEAR)] = False,
    free_derivative: Annotated[
        bool,
        typer.Option(
            "--free-derivative",
            help="Let the derivative's filter be faster than the sampling, and differentiate the "
            "set point.",
        ),
    ] = False,
    vary: Annotated[
        str,
        typer.Option(
            help="Study file: gains for models drawn as its cases are, judged by others.",
            metavar="FILE",
        ),
    ] = "",
    drawn: Annotated[int, typer.Option(help="Models drawn for the gains.")] = 64,
    probability: Annotated[
        str, typer.Option(help="Of all requirements together, e.g. '99 %'; needs --vary.")
    ] = "",
    seed: Annotated[int, typer.Option(help="Seed of the searches.", min=0)] = 0,
    side: Side = "",
    out: OutFolder = None,
    json: JsonFlag = False,
) -> None:
    """Choose a loop's gains from requirements; exit status 1 when they cannot be met."""
    from bywire.api.design import design

    show(
        lambda progress: design(
            loop,
            parameters,
            at,
            changes(set_),
            require=require or (),
            requirements=requirements,
            over=over or (),
            amplitudes=amplitudes,
            schedule=schedule,
            linear_only=linear_only,
            free_derivative=free_derivative,
            vary=vary,
            drawn=drawn,
            probability=probability,
            seed=seed,
            progress=progress,
            side=side,
        ),
        out,
        json,
    )
