"""Options of the commands that run what is ready: benches, papers, the benchmark."""

from __future__ import annotations

import sys
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Annotated

import typer

from bywire.cli import completion
from bywire.cli.options import (
    BenchChanges,
    BenchFile,
    ErrorEstimate,
    JsonFlag,
    OutFolder,
    changes,
)
from bywire.cli.show import show
from bywire.core import option_texts as texts
from bywire.core.errors import InputError


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


def run(
    bench: BenchFile,
    set_: BenchChanges = None,
    over: Annotated[str, typer.Option(help=texts.RUN_OVER)] = "",
    fault: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME[=VALUE][@ONSET]", help=texts.RUN_FAULT),
    ] = None,
    engine: Annotated[
        str, typer.Option(help="What computes, e.g. sil: the ECU's compiled C in the loop.")
    ] = "auto",
    error_estimate: ErrorEstimate = True,
    animate: Annotated[
        bool, typer.Option("--animate", help="Write pages that play the runs, with --out.")
    ] = False,
    out: OutFolder = None,
    json: JsonFlag = False,
) -> None:
    """Run a bench file or an experiment; exit status 1 unless every requirement is met."""
    from bywire.api.run import run as run_bench
    from bywire.core.errors import InputError

    if animate and out is None:
        raise InputError("--animate writes into a folder: give one by --out")
    show(
        lambda progress: run_bench(
            bench,
            changes(set_),
            over=over,
            faults=fault or (),
            progress=progress,
            engine=engine,
            estimate_error=error_estimate,
            animate=animate,
        ),
        out,
        json,
    )


def reproduce_command(
    source: Annotated[str, typer.Argument(help=texts.SOURCE)],
    out: OutFolder = None,
    json: JsonFlag = False,
) -> None:
    """Make a paper's tables and figures: stated, computed, agrees or not."""
    from bywire.api.reproduce import reproduce

    show(lambda progress: reproduce(source, progress=progress), out, json)


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
