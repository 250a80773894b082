"""What the commands share: the types of their options."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from bywire.cli import completion
from bywire.cli.output_folder import folder
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
        help="Bench file (TOML), or an experiment.", metavar="BENCH", show_default=False,
        autocompletion=completion.BENCHES,
    ),
]  # fmt: skip
LoopName = Annotated[
    str,
    typer.Argument(
        help="Loop, see 'bywire list'.", show_default=False, autocompletion=completion.LOOPS
    ),
]
Parameters = Annotated[
    str, typer.Option(help="Parameter set, e.g. roberts2003.", autocompletion=completion.SETS)
]
At = Annotated[str, typer.Option("--at", help="Operating point, e.g. '20 bar'.")]
Changes = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="Change a parameter, e.g. motor.R_m=0.4ohm.",
                 autocompletion=completion.changeable),
]
BenchChanges = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="Change the bench, e.g. motor.R_m=0.4ohm.",
                 autocompletion=completion.changeable),
]
ErrorEstimate = Annotated[
    bool, typer.Option(help="Run in other steps too, for the error of all figures.")
]
Frequencies = Annotated[
    str, typer.Option(help="Frequencies, e.g. '1 Hz:150 Hz:20', or a list.")
]
Map = Annotated[
    Path | None, typer.Option("--map", metavar="PATH", help="What the columns mean (TOML).")
]
Inputs = Annotated[
    list[str] | None,
    typer.Option("--input", metavar="STIMULUS=SIGNAL", help="What drives the model."),
]
CaseName = Annotated[
    str, typer.Option("--case", help="Run of the experiment; the first by default.")
]
