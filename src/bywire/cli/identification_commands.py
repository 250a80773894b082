"""Options of the commands that go from measurements to parameters."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from bywire.cli import completion
from bywire.cli.options import (
    BenchChanges,
    CaseName,
    Changes,
    ErrorEstimate,
    Inputs,
    JsonFlag,
    Map,
    OutFolder,
    Parameters,
    Time,
    changes,
    named,
)
from bywire.cli.show import show
from bywire.core import option_texts as texts
from bywire.core.errors import ParameterError

# What methods of any bench take.
_ANY_BENCH = "Methods of any bench"
TestBench = Annotated[
    Path | None,
    typer.Option("--bench", help=texts.TEST_BENCH, rich_help_panel=_ANY_BENCH),
]
NoisyOutputs = Annotated[
    list[str] | None,
    typer.Option(
        "--output", metavar="SIGNAL[=COLUMN]", rich_help_panel=_ANY_BENCH, help=texts.NOISY_OUTPUT
    ),
]
Unknowns = Annotated[
    list[str] | None,
    typer.Option(
        "--unknown", metavar="NAME[=LOW..HIGH]", rich_help_panel=_ANY_BENCH, help=texts.UNKNOWN
    ),
]
Priors = Annotated[
    list[str] | None,
    typer.Option(
        "--prior", metavar="NAME=VALUE+-DEV", rich_help_panel=_ANY_BENCH, help=texts.PRIOR
    ),
]
States = Annotated[
    list[str] | None,
    typer.Option("--estimate-start", metavar="STATE", rich_help_panel=_ANY_BENCH, help=texts.START),
]
Loss = Annotated[
    str,
    typer.Option(rich_help_panel=_ANY_BENCH, help=texts.LOSS),
]
Holdout = Annotated[
    Path | None,
    typer.Option(rich_help_panel=_ANY_BENCH, help=texts.HOLDOUT),
]


def identify(
    method: Annotated[
        str,
        typer.Argument(help=texts.METHOD, show_default=False, autocompletion=completion.METHODS),
    ],
    measurements: Annotated[
        list[Path] | None,
        typer.Argument(metavar="[MEASUREMENT]...", help=texts.MEASUREMENTS, show_default=False),
    ] = None,
    map_: Map = None,
    time: Time = "",
    parameters: Parameters = "",
    set_: Changes = None,
    option: Annotated[
        list[str] | None,
        typer.Option("--option", metavar="KEY=VALUE", help=texts.METHOD_OPTION),
    ] = None,
    starts: Annotated[int | None, typer.Option(help=texts.STARTS, min=1)] = None,
    seed: Annotated[int, typer.Option(help=texts.SEED, min=0)] = 1,
    synthetic: Annotated[
        int | None,
        typer.Option(metavar="SEED", help=texts.SYNTHETIC, min=0),
    ] = None,
    study: Annotated[
        int | None,
        typer.Option(metavar="COUNT", help="Try the method on many simulated ones.", min=2),
    ] = None,
    bench: TestBench = None,
    input_: Inputs = None,
    output: NoisyOutputs = None,
    unknown: Unknowns = None,
    prior: Priors = None,
    start: States = None,
    case: CaseName = "",
    loss: Loss = "",
    holdout: Holdout = None,
    out: OutFolder = None,
    json: JsonFlag = False,
) -> None:
    """Identify parameters with their confidence from measurements; status 1 if a check fails."""
    from bywire.api.identify import identify as identify_parameters
    from bywire.api.trust import trust
    from bywire.identification.fitting.question import Question

    question = Question(
        bench,
        changes(input_, "--input"),
        named(output, "--output"),
        named(unknown, "--unknown"),
        changes(prior, "--prior"),
        start or (),
        case,
        holdout,
        loss,
    )
    shared: dict[str, Any] = {
        "parameters": parameters,
        "overrides": changes(set_),
        "question": question,
        "options": changes(option, "--option"),
        "seed": seed,
        "folder": out,
    }
    if study is None:
        show(
            lambda progress: identify_parameters(
                method,
                measurements or [],
                mapping=map_,
                time=time,
                starts=starts or 16,
                synthetic=synthetic,
                progress=progress,
                **shared,
            ),
            out,
            json,
        )
        return
    _require_no_measurement(method, measurements, synthetic, map_, time or None, holdout)
    count = study
    show(
        lambda progress: trust(method, count, starts=starts or 1, progress=progress, **shared),
        out,
        json,
    )


def _require_no_measurement(
    method: str,
    measurements: object,
    synthetic: int | None,
    mapping: object,
    time: object,
    holdout: object,
) -> None:
    """Refuse what a study of simulated experiments cannot use."""
    if measurements or synthetic is not None:
        raise ParameterError(
            f"{method}: give only one of measurement files, --synthetic SEED, --study COUNT"
        )
    for flag, value in {"--map": mapping, "--time": time, "--holdout": holdout}.items():
        if value is not None:
            raise ParameterError(f"{flag} is for measurement files: leave it out")


def replay(
    measurement: Annotated[Path, typer.Argument(help=texts.MEASUREMENT, show_default=False)],
    bench: Annotated[Path, typer.Option(help=texts.TEST_BENCH)],
    map_: Map = None,
    set_: BenchChanges = None,
    input_: Inputs = None,
    output: Annotated[
        list[str] | None,
        typer.Option("--output", metavar="SIGNAL[=COLUMN]", help=texts.REPLAY_OUTPUT),
    ] = None,
    time: Time = "",
    case: CaseName = "",
    tolerance: Annotated[
        list[str] | None,
        typer.Option(help=texts.TOLERANCE),
    ] = None,
    segments: Annotated[
        str, typer.Option(help="Judge stretches: auto (steps and holds), or a TOML file.")
    ] = "",
    track: Annotated[
        list[str] | None,
        typer.Option(help=texts.TRACK),
    ] = None,
    error_estimate: ErrorEstimate = True,
    out: OutFolder = None,
    json: JsonFlag = False,
) -> None:
    """Drive the model with a measured demand and compare; status 1 if a tolerance is missed."""
    from bywire.api.replay import replay as replay_measurement

    show(
        lambda progress: replay_measurement(
            measurement,
            bench,
            changes(set_),
            mapping=map_,
            inputs=changes(input_, "--input"),
            outputs=named(output, "--output"),
            time=time,
            case=case,
            tolerances=tolerance or [],
            segments=segments,
            track=track or [],
            progress=progress,
            estimate_error=error_estimate,
        ),
        out,
        json,
    )
