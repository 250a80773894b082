"""Commands on measurement files."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated

import typer

from bywire.cli.options import JsonFlag, Map, Time
from bywire.cli.show import show


def convert(
    source: Annotated[
        Path, typer.Argument(metavar="IN", help="Measurement file.", show_default=False)
    ],
    target: Annotated[
        Path, typer.Argument(metavar="OUT", help="File to write.", show_default=False)
    ],
    map_: Map = None,
    signals: Annotated[
        str, typer.Option(help="Signals to keep, e.g. 'p_mc, x_mc' or 'p_mc=Pressure [psi]'.")
    ] = "",
    time: Time = "",
    rate: Annotated[
        str, typer.Option(help="Bring all signals to one time axis, e.g. '1 kHz'.")
    ] = "",
    method: Annotated[
        str, typer.Option(help="How: linear (default), previous, nearest, average.")
    ] = "",
    exclude: Annotated[
        str,
        typer.Option(help="Leave out gaps, missing (both by default), clipped; or nothing."),
    ] = "",
    max_gap: Annotated[
        str, typer.Option(help="Longest pause that is no gap, e.g. '50 ms'; 10 steps by default.")
    ] = "",
    format_: Annotated[
        str, typer.Option("--format", help="Format to write, e.g. mat73; else by the ending.")
    ] = "",
    force: Annotated[bool, typer.Option("--force", help="Replace a file that is there.")] = False,
    json: JsonFlag = False,
) -> None:
    """Convert a measurement file: CSV, TSV, Parquet, MAT, MDF4, NetCDF."""
    from bywire.api.convert import convert as convert_file

    left_out = [] if exclude == "nothing" else _listed(exclude)
    show(
        lambda progress: convert_file(
            source,
            target,
            mapping=map_,
            signals=_listed(signals),
            time=time,
            rate=rate or None,
            method=method,
            exclude=left_out if exclude else None,
            max_gap=max_gap,
            format=format_,
            force=force,
            progress=progress,
        ),
        as_json=json,
    )


def _listed(text: str) -> list[str]:
    """Return the parts between commas; those within brackets are of a name, as ``ans(2,:)``."""
    return [part.strip() for part in re.split(r",(?![^(\[]*[)\]])", text) if part.strip()]
