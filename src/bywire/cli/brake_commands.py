"""Options of the commands for who writes a brake: check, new."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from bywire.cli.options import JsonFlag, OutFolder
from bywire.cli.output_folder import folder
from bywire.cli.show import show


def check_command(
    name: Annotated[
        str | None,
        typer.Argument(
            help="A brake, model, experiment, element, control law or parameter set; what --system "
            "loads, else all."
        ),
    ] = None,
    out: OutFolder = None,
    json: JsonFlag = False,
) -> None:
    """Put a brake or an element to the test of every contract; exit status 1 where one fails."""
    from bywire.api.check import check

    show(lambda progress: check(name, progress=progress), out, json)


def new_command(
    name: Annotated[str, typer.Argument(help="Name of the brake, e.g. my-brake.")],
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            metavar="PATH",
            parser=folder,
            help="Folder in which its own is made; the current one by default.",
        ),
    ] = None,
    json: JsonFlag = False,
) -> None:
    """Write a package for a brake of your own, with tests, that passes bywire check."""
    from bywire.api.new import new

    show(lambda progress: new(name, out or Path()), None, json)
