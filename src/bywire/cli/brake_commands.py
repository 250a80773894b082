"""Options of the commands for who writes a brake: check, new."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from bywire.cli.options import JsonFlag, OutFolder
from bywire.cli.show import show

SystemPath = Annotated[
    Path | None,
    typer.Option("--system", metavar="PATH", help="File or folder of a brake; its code is run."),
]


def check_command(
    name: Annotated[
        str | None,
        typer.Argument(help="A brake, model, element, control law or parameter set."),
    ] = None,
    system: SystemPath = None,
    out: OutFolder = None,
    json: JsonFlag = False,
) -> None:
    """Put a brake or an element to the test of every contract; exit status 1 where one fails."""
    from bywire.api.check import check

    show(lambda progress: check(name, system=system, progress=progress), out, json)
