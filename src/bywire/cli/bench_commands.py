"""The commands that are no use cases of one function: list, benchmark."""

from __future__ import annotations

from typing import Annotated

import typer

from bywire.cli import completion
from bywire.cli.options import JsonFlag
from bywire.cli.show import show


def list_command(
    name: Annotated[
        str | None,
        typer.Argument(
            metavar="[TOPIC|NAME|WORD]",
            help="A kind of things; or a name: its options, signals, units; or what it is about.",
            autocompletion=completion.ANYTHING,
        ),
    ] = None,
    json: JsonFlag = False,
) -> None:
    """Show what there is: kinds of things, the names of one kind, or all about a name."""
    from bywire.api.overview import is_topic, overview

    if name is None or is_topic(name):
        show(lambda _: overview(name or ""), as_json=json)
        return
    from bywire.api.describe import describe

    show(lambda _: describe(name), as_json=json)


def benchmark_command(
    parts: Annotated[
        list[str] | None,
        typer.Argument(metavar="[PART]...", help="What to measure, e.g. commands; else all."),
    ] = None,
    json: JsonFlag = False,
) -> None:
    """Measure speed against hand-written C and what users would pick instead."""
    from bywire.benchmark.suite import measure

    show(lambda progress: measure(progress, parts or ()), as_json=json)
