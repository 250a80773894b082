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
    Side,
    changes,
)
from bywire.cli.show import show
from bywire.core import option_texts as texts

LoopOrPlant = Annotated[
    str,
    typer.Argument(
        help=texts.LOOP_OR_PLANT,
        show_default=False,
        autocompletion=completion.LOOPS_OR_PLANTS,
    ),
]


def linearize_command(
    loop: LoopOrPlant,
    parameters: Parameters = "",
    at: At = "",
    set_: Changes = None,
    locus: Annotated[str, typer.Option(help=texts.LOCUS)] = "",
    reduce: Annotated[str, typer.Option(help=texts.REDUCE)] = "",
    friction: Annotated[str, typer.Option(help=texts.FRICTION)] = "",
    speed: Annotated[str, typer.Option(help=texts.SPEED)] = "",
    dither: Annotated[bool, typer.Option("--dither", help=texts.DITHER)] = False,
    side: Side = "",
    out: OutFolder = None,
    json: JsonFlag = False,
) -> None:
    """Make the exact linear model of a closed loop, with its sampling, or of a plant."""
    from bywire.api.linearize import linearize

    show(
        lambda _: linearize(
            loop,
            parameters,
            at,
            changes(set_),
            locus=locus,
            reduce=reduce,
            friction=friction,
            speed=speed,
            dither=dither,
            side=side,
        ),
        out,
        json,
    )


def frequency_response_command(
    loop: LoopName,
    parameters: Parameters = "",
    at: At = "",
    set_: Changes = None,
    frequencies: Frequencies = "",
    amplitudes: Annotated[str, typer.Option(help=texts.AMPLITUDES)] = "",
    excitation: Annotated[str, typer.Option(help=texts.EXCITATION)] = "sine",
    over: Annotated[str, typer.Option(help=texts.BANDWIDTH_OVER)] = "",
    error_estimate: ErrorEstimate = True,
    side: Side = "",
    out: OutFolder = None,
    json: JsonFlag = False,
) -> None:
    """Measure a closed loop's response by amplitude: friction, limits and sampling included."""
    from bywire.api.frequency_response import frequency_response

    show(
        lambda progress: frequency_response(
            loop,
            parameters,
            at,
            changes(set_),
            frequencies=frequencies,
            amplitudes=amplitudes,
            excitation=excitation,
            over=over,
            progress=progress,
            estimate_error=error_estimate,
            side=side,
        ),
        out,
        json,
    )


def agreement_command(
    loop: LoopName,
    parameters: Parameters = "",
    at: At = "",
    set_: Changes = None,
    frequencies: Frequencies = "",
    amplitudes: Annotated[str, typer.Option(help=texts.AGREEMENT_AMPLITUDES)] = "",
    side: Side = "",
    out: OutFolder = None,
    json: JsonFlag = False,
) -> None:
    """Show what makes a loop nonlinear, cause by cause; exit status 1 when it does not add up."""
    from bywire.api.agreement import agreement

    show(
        lambda progress: agreement(
            loop,
            parameters,
            at,
            changes(set_),
            frequencies=frequencies,
            amplitudes=amplitudes,
            progress=progress,
            side=side,
        ),
        out,
        json,
    )


def margins_command(
    loop: LoopName,
    parameters: Parameters = "",
    at: At = "",
    set_: Changes = None,
    over: Annotated[str, typer.Option(help=texts.MARGINS_OVER)] = "",
    side: Side = "",
    out: OutFolder = None,
    json: JsonFlag = False,
) -> None:
    """Show margins and bandwidth of a loop as it is sampled, and the worst case over a range."""
    from bywire.api.margins import margins

    show(lambda _: margins(loop, parameters, at, changes(set_), over, side=side), out, json)
