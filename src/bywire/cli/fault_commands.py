"""Options of the command that runs campaigns of faults."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from bywire.cli import completion
from bywire.cli.options import BenchChanges, JsonFlag, OutFolder, changes
from bywire.cli.show import show
from bywire.core import option_texts as texts


def faults_command(
    campaign: Annotated[
        str,
        typer.Argument(
            help=texts.CAMPAIGN, show_default=False, autocompletion=completion.CAMPAIGNS
        ),
    ],
    set_: BenchChanges = None,
    out: OutFolder = None,
    json: JsonFlag = False,
) -> None:
    """Let every part fail in a maneuver: what it does, when it is seen, what is covered."""
    from bywire.api.run_faults import run_faults

    place = None if out is None else Path(out)
    show(
        lambda progress: run_faults(campaign, place, changes(set_), progress=progress), place, json
    )
