"""The command that projects how a brake wears."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from bywire.cli import completion
from bywire.cli.options import BenchChanges, JsonFlag, OutFolder, changes
from bywire.cli.show import show


def life_command(
    life: Annotated[
        Path,
        typer.Argument(help="Life file (TOML), or the name of a life.", show_default=False,
                       autocompletion=completion.LIVES),
    ],
    set_: BenchChanges = None,
    check: Annotated[
        int, typer.Option(help="Stops to run one by one as well, to check the projection.", min=0)
    ] = 0,
    out: OutFolder = None,
    json: JsonFlag = False,
) -> None:
    """Project how a brake wears over thousands of stops, and when its life ends."""
    from bywire.api.life import project_life

    show(
        lambda progress: project_life(life, changes(set_), check=check, progress=progress),
        out, json,
    )  # fmt: skip
