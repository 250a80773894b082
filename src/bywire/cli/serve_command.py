"""Options of the command that serves a folder to a browser of this machine."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from bywire.cli import completion
from bywire.cli.output import INTERRUPTED, message, result
from bywire.core.interrupts import interrupt_heard
from bywire.server.address import PORT


def serve_command(
    subject: Annotated[
        Path | None,
        typer.Argument(
            metavar="[BENCH|FOLDER]",
            show_default=False,
            autocompletion=completion.names_of(
                "experiments", "generic_experiments", ending=".toml"
            ),
            help="Bench file, experiment or folder; the current folder by default.",
        ),
    ] = None,
    port: Annotated[int, typer.Option(help="Port; 0 for any that is free.")] = PORT,
    folder: Annotated[
        Path | None,
        typer.Option(
            help="What is served; by default the folder of the bench file.", show_default=False
        ),
    ] = None,
) -> None:
    """Show benches, results and studies in a browser of this machine, and compute what they ask."""
    from bywire.server.serving import serve

    def say(link: str) -> None:
        message("open this link in a browser of this machine; Ctrl-C ends the server")
        result(link)

    try:
        serve(subject or "", port=port, folder=folder or "", say=say)
    except KeyboardInterrupt:  # typer would exit without a word
        interrupt_heard()
        message("interrupted")
        raise typer.Exit(INTERRUPTED) from None
