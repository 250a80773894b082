"""The command that projects how a brake wears."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from bywire.cli import completion
from bywire.cli.options import BenchChanges, JsonFlag, OutFolder, changes
from bywire.cli.show import show
from bywire.core import option_texts as texts


def life_command(
    life: Annotated[
        Path,
        typer.Argument(help=texts.LIFE, show_default=False, autocompletion=completion.LIVES),
    ],
    set_: BenchChanges = None,
    check: Annotated[int, typer.Option(help=texts.LIFE_CHECK, min=0)] = 0,
    out: OutFolder = None,
    json: JsonFlag = False,
) -> None:
    """Project how a brake wears over thousands of stops, and when its life ends."""
    from bywire.api.life import project_life

    show(
        lambda progress: project_life(life, changes(set_), check=check, progress=progress),
        out,
        json,
    )
