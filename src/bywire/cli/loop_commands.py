"""Options of the commands that analyze a control loop."""

from __future__ import annotations

from typing import Annotated

import typer

from bywire.cli import completion
from bywire.cli.options import (
    At,
    Changes,
    ErrorEstimate,
    Frequencies,
    JsonFlag,
    LoopName,
    OutFolder,
    Parameters,
    changes,
)
from bywire.cli.show import show

LoopOrPlant = Annotated[
    str,
    typer.Argument(
        help="Loop or plant, see 'bywire list'.", show_default=False,
        autocompletion=completion.LOOPS_OR_PLANTS,
    ),
]  # fmt: skip


def linearize_command(
    loop: LoopOrPlant,
    parameters: Parameters = "",
    at: At = "",
    set_: Changes = None,
    locus: Annotated[
        str, typer.Option(help="Poles over a range, e.g. motor.R_m=0.1ohm:1ohm:71.")
    ] = "",
    reduce: Annotated[
        str, typer.Option(help="Reduce it to an order, e.g. 4, or to a band, e.g. '150 Hz'.")
    ] = "",
    friction: Annotated[
        str, typer.Option(help="Of a plant: removed (as of loops), sliding, or stuck.")
    ] = "",
    speed: Annotated[str, typer.Option(help="Motor speed of sliding, e.g. '5 rad/s'.")] = "",
    dither: Annotated[
        bool, typer.Option("--dither", help="Also about its motion under dither, friction on.")
    ] = False,
    out: OutFolder = None,
    json: JsonFlag = False,
) -> None:
    """Make the exact linear model of a closed loop, with its sampling, or of a plant."""
    from bywire.api.linearize import linearize

    show(
        lambda _: linearize(
            loop, parameters, at, changes(set_), locus=locus, reduce=reduce, friction=friction,
            speed=speed, dither=dither,
        ),
        out, json,
    )  # fmt: skip


def frequency_response_command(
    loop: LoopName,
    parameters: Parameters = "",
    at: At = "",
    set_: Changes = None,
    frequencies: Frequencies = "",
    amplitudes: Annotated[str, typer.Option(help="Amplitudes, e.g. '0.5 rad, 1 rad'.")] = "",
    excitation: Annotated[
        str, typer.Option(help="sine (one frequency at a time), multisine, or chirp.")
    ] = "sine",
    over: Annotated[
        str, typer.Option(help="Range, for bandwidths, e.g. motor.R_m=0.2ohm:0.6ohm:5.")
    ] = "",
    error_estimate: ErrorEstimate = True,
    out: OutFolder = None,
    json: JsonFlag = False,
) -> None:
    """Measure a closed loop's response by amplitude: friction, limits and sampling included."""
    from bywire.api.frequency_response import frequency_response

    show(
        lambda progress: frequency_response(
            loop, parameters, at, changes(set_), frequencies=frequencies, amplitudes=amplitudes,
            excitation=excitation, over=over, progress=progress, estimate_error=error_estimate,
        ),
        out, json,
    )  # fmt: skip


def agreement_command(
    loop: LoopName,
    parameters: Parameters = "",
    at: At = "",
    set_: Changes = None,
    frequencies: Frequencies = "",
    amplitudes: Annotated[
        str, typer.Option(help="A small and a large amplitude, e.g. '0.001 rad, 1 rad'.")
    ] = "",
    out: OutFolder = None,
    json: JsonFlag = False,
) -> None:
    """Show what makes a loop nonlinear, cause by cause; exit status 1 when it does not add up."""
    from bywire.api.agreement import agreement

    show(
        lambda progress: agreement(
            loop, parameters, at, changes(set_), frequencies=frequencies, amplitudes=amplitudes,
            progress=progress,
        ),
        out, json,
    )  # fmt: skip


def margins_command(
    loop: LoopName,
    parameters: Parameters = "",
    at: At = "",
    set_: Changes = None,
    over: Annotated[
        str, typer.Option(help="Range, e.g. motor.R_m=0.2ohm:0.6ohm:9 or at=5bar:35bar:7.")
    ] = "",
    out: OutFolder = None,
    json: JsonFlag = False,
) -> None:
    """Show margins and bandwidth of a loop as it is sampled, and the worst case over a range."""
    from bywire.api.margins import margins

    show(lambda _: margins(loop, parameters, at, changes(set_), over), out, json)
