"""The commands that are no use cases of one function: list, benchmark."""

from __future__ import annotations

import sys
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Annotated

import typer

from bywire.cli import completion
from bywire.cli.options import JsonFlag
from bywire.cli.show import show
from bywire.core.errors import InputError


def list_command(
    name: Annotated[
        str | None,
        typer.Argument(
            metavar="[TOPIC|NAME|WORD]",
            help="A kind of things; or a name: its options, signals, units; or what it is about.",
            autocompletion=completion.names_of(),
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
    show(lambda progress: _benchmarks().measure(progress, parts or ()), as_json=json)


def _benchmarks() -> ModuleType:
    """Load the benchmarks, which stand in a clone of the repository beside ``src``.

    Raises
    ------
    InputError
        Where bywire runs from anywhere else.
    """
    clone = Path(__file__).parents[3]
    if not (clone / "benchmarks" / "suite.py").is_file():
        raise InputError(
            "the benchmarks come with a clone of bywire's repository: run python3 tasks.py demo in "
            "it, then .venv/bin/bywire benchmark"
        )
    sys.path.insert(0, str(clone))
    return import_module("benchmarks.suite")
