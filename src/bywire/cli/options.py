"""What the commands share: the types of their options."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from bywire.cli import completion
from bywire.cli.output_folder import folder
from bywire.core import option_texts as texts
from bywire.core.pairs import changes as changes
from bywire.core.pairs import named as named

JsonFlag = Annotated[bool, typer.Option("--json", help="Print one JSON object on standard output.")]
OutFolder = Annotated[
    Path | None,
    typer.Option(
        "--out",
        help="Folder for recordings, figures and the report.",
        parser=folder,
        metavar="PATH",
    ),
]
BenchFile = Annotated[
    Path,
    typer.Argument(
        help="Bench file (TOML), or an experiment.",
        metavar="BENCH",
        show_default=False,
        autocompletion=completion.BENCHES,
    ),
]
LoopName = Annotated[
    str,
    typer.Argument(help=texts.LOOP, show_default=False, autocompletion=completion.LOOPS),
]
Parameters = Annotated[str, typer.Option(help=texts.PARAMETERS, autocompletion=completion.SETS)]
At = Annotated[str, typer.Option("--at", help=texts.AT)]
Changes = Annotated[
    list[str] | None,
    typer.Option(
        "--set", metavar="KEY=VALUE", help=texts.CHANGES, autocompletion=completion.changeable
    ),
]
BenchChanges = Annotated[
    list[str] | None,
    typer.Option(
        "--set", metavar="KEY=VALUE", help=texts.BENCH_CHANGES, autocompletion=completion.changeable
    ),
]
Side = Annotated[str, typer.Option("--side", help=texts.SIDE)]
ErrorEstimate = Annotated[bool, typer.Option(help=texts.ERROR_ESTIMATE)]
Frequencies = Annotated[str, typer.Option(help=texts.FREQUENCIES)]
Map = Annotated[Path | None, typer.Option("--map", metavar="PATH", help=texts.MAP)]
Inputs = Annotated[
    list[str] | None,
    typer.Option("--input", metavar="STIMULUS=COLUMN", help=texts.INPUTS),
]
Time = Annotated[str, typer.Option("--time", metavar="COLUMN", help=texts.TIME)]
CaseName = Annotated[str, typer.Option("--case", help=texts.CASE)]
