"""Options of the command that writes a bench as a page."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from bywire.cli.completion import varied
from bywire.cli.options import BenchChanges, BenchFile, JsonFlag, changes
from bywire.cli.show import show


def page_command(
    bench: BenchFile,
    out: Annotated[
        Path, typer.Option("--out", help="File of the page (.html).", show_default=False)
    ],
    vary: Annotated[
        list[str] | None,
        typer.Option(
            help="Parameter that stands first in the page; may be given several times.",
            autocompletion=varied,
        ),
    ] = None,
    case: Annotated[
        str, typer.Option("--case", help="Run of the experiment; needed where there are several.")
    ] = "",
    set_: BenchChanges = None,
    json: JsonFlag = False,
) -> None:
    """Write a bench as one HTML file that computes it: parameters to move, curves that follow."""
    from bywire.api.page import page

    show(lambda _: page(bench, out, changes(set_), vary=vary or (), case=case), None, json)
