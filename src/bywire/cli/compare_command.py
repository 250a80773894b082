"""Options of the command that lays runs beside each other."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from bywire.cli import completion
from bywire.cli.options import BenchChanges, ErrorEstimate, JsonFlag, OutFolder, changes
from bywire.cli.show import show
from bywire.core import option_texts as texts


def compare(
    runs: Annotated[
        list[Path],
        typer.Argument(
            metavar="RUN RUN...",
            help=texts.COMPARE_RUNS,
            show_default=False,
            autocompletion=completion.BENCHES,
        ),
    ],
    set_: BenchChanges = None,
    full: Annotated[bool, typer.Option("--full", help=texts.COMPARE_FULL)] = False,
    error_estimate: ErrorEstimate = True,
    out: OutFolder = None,
    json: JsonFlag = False,
) -> None:
    """Compare runs: settings and key figures that differ, verdicts, curves on top of each other."""
    from bywire.api.compare import compare as compare_runs

    show(
        lambda progress: compare_runs(
            *runs,
            overrides=changes(set_),
            is_full=full,
            progress=progress,
            estimate_error=error_estimate,
        ),
        out,
        json,
    )
