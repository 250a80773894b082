"""The command ``bywire``."""

from __future__ import annotations

import traceback
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any

import typer

from bywire.cli.output import flush, message, open_streams, result
from bywire.cli.output_folder import folder
from bywire.core.errors import BywireError, ParameterError

INTERRUPTED = 130
FAILED = 3

app = typer.Typer(
    name="bywire",
    help="A virtual test bench for brake-by-wire actuators.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)

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


LoopName = Annotated[str, typer.Argument(help="Loop, see 'bywire list'.", show_default=False)]
Parameters = Annotated[str, typer.Option(help="Parameter set, e.g. roberts2003.")]
At = Annotated[str, typer.Option("--at", help="Operating point, e.g. '20 bar'.")]
Changes = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="Change a parameter, e.g. wedge.mu_B=0.4."),
]


# Each command loads what it needs when it runs, so that `bywire --help` stays quick.
def _execute(name: str, *arguments: Any) -> Any:
    try:
        return import_module(f"bywire.cli.{name}").execute(*arguments)
    except KeyboardInterrupt:  # typer would exit without a word
        message("interrupted")
        raise typer.Exit(INTERRUPTED) from None


@app.command("list")
def list_command(json: JsonFlag = False) -> None:
    """Show assemblies, parameter sets, experiments, stimuli and KPIs."""
    _execute("list_command", json)


@app.command()
def run(
    bench: Annotated[
        Path,
        typer.Argument(help="Bench file (TOML), or an experiment's name.", show_default=False),
    ],
    set_: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="KEY=VALUE", help="Change the bench, e.g. motor.R_m=0.4ohm."),
    ] = None,
    out: OutFolder = None,
    json: JsonFlag = False,
) -> None:
    """Run a bench file or an experiment; exit status 1 when a requirement is not met."""
    raise typer.Exit(_execute("run_command", bench, _changes(set_ or []), out, json))


@app.command()
def reproduce(
    source: Annotated[str, typer.Argument(help="Published source, e.g. dardanelli2010.")],
    out: OutFolder = None,
    json: JsonFlag = False,
) -> None:
    """Make a paper's tables and figures: stated, computed, agrees or not."""
    _execute("reproduce_command", source, out, json)


@app.command()
def benchmark(json: JsonFlag = False) -> None:
    """Measure speed against hand-written C and what users would pick instead."""
    _execute("benchmark_command", json)


@app.command("linearize")
def linearize_command(
    loop: LoopName,
    parameters: Parameters = "",
    at: At = "",
    set_: Changes = None,
    out: OutFolder = None,
    json: JsonFlag = False,
) -> None:
    """Make the exact linear model of a closed loop: plant, filters, controllers, sampling."""
    _execute("linearize_command", loop, parameters, at, _changes(set_ or []), out, json)


@app.command("frequency-response")
def frequency_response_command(
    loop: LoopName,
    parameters: Parameters = "",
    at: At = "",
    set_: Changes = None,
    frequencies: Annotated[
        str, typer.Option(help="Frequencies, e.g. '1 Hz:150 Hz:40', or a list.")
    ] = "",
    amplitudes: Annotated[str, typer.Option(help="Amplitudes, e.g. '0.5 rad, 1 rad'.")] = "",
    excitation: Annotated[
        str, typer.Option(help="sine (one frequency at a time), multisine, or chirp.")
    ] = "sine",
    out: OutFolder = None,
    json: JsonFlag = False,
) -> None:
    """Measure a closed loop's response by amplitude: friction, limits and sampling included."""
    _execute(
        "frequency_response_command", loop, parameters, at, _changes(set_ or []), frequencies,
        amplitudes, excitation, out, json,
    )  # fmt: skip


@app.command("margins")
def margins_command(
    loop: LoopName,
    parameters: Parameters = "",
    at: At = "",
    set_: Changes = None,
    over: Annotated[
        str, typer.Option(help="Range of a parameter, e.g. wedge.mu_B=0.2:0.6:9.")
    ] = "",
    json: JsonFlag = False,
) -> None:
    """Show margins and bandwidth of a loop as it is sampled, and the worst case over a range."""
    _execute("margins_command", loop, parameters, at, _changes(set_ or []), over, json)


@app.command("study")
def study_command(
    name: Annotated[
        str, typer.Argument(help="Sizing study, see 'bywire list'.", show_default=False)
    ],
    parameters: Parameters = "",
    set_: Annotated[
        list[str] | None,
        typer.Option(
            "--set", metavar="KEY=VALUE", help="Change an option or a parameter, e.g. t_90=120ms."
        ),
    ] = None,
    out: OutFolder = None,
    json: JsonFlag = False,
) -> None:
    """Compare designs of a brake at equal demands: the best, what limits it, at what price."""
    _execute("study_command", name, parameters, _changes(set_ or []), out, json)


@app.command("design")
def design_command(
    loop: LoopName,
    parameters: Parameters = "",
    at: At = "",
    set_: Changes = None,
    require: Annotated[
        list[str] | None,
        typer.Option(help="Requirement, e.g. 'bandwidth >= 10 Hz'; as often as needed."),
    ] = None,
    requirements: Annotated[
        Path | None, typer.Option(help="TOML file with a section 'requirements'.")
    ] = None,
    over: Annotated[
        list[str] | None,
        typer.Option(help="Range to serve as well, e.g. wedge.mu_B=0.2:0.6:5; may be repeated."),
    ] = None,
    amplitudes: Annotated[
        str, typer.Option(help="Amplitudes of the sines on the bench, e.g. '1 bar, 3 bar'.")
    ] = "",
    linear_only: Annotated[
        bool, typer.Option("--linear-only", help="Leave out the nonlinear bench.")
    ] = False,
    seed: Annotated[int, typer.Option(help="Seed of the searches.", min=0)] = 0,
    out: OutFolder = None,
    json: JsonFlag = False,
) -> None:
    """Choose a loop's gains from requirements; exit status 1 when they cannot be met."""
    from bywire.cli.design_command import Wanted

    wanted = Wanted(requirements, require or [], over or [], amplitudes, linear_only, seed)
    status = _execute(
        "design_command", loop, parameters, at, _changes(set_ or []), wanted, out, json
    )  # fmt: skip
    raise typer.Exit(status)


@app.callback(invoke_without_command=True)
def _root(
    version: Annotated[bool, typer.Option("--version", help="Print the version.")] = False,
) -> None:
    if version:
        from bywire import __version__

        result(__version__)
        raise typer.Exit


def _changes(texts: list[str]) -> dict[str, str]:
    changes: dict[str, str] = {}
    for text in texts:
        key, equals, value = (part.strip() for part in text.partition("="))
        if not equals or not key or not value:
            raise ParameterError(f"--set {text}: write KEY=VALUE, for instance motor.R_m=0.4ohm")
        if key in changes:
            raise ParameterError(f"--set {text}: {key} is set twice: leave one of them out")
        changes[key] = value
    return changes


def main() -> None:
    """Run the command line; errors meant for the user become one message and an exit status."""
    open_streams()
    status = _status()
    flush()
    raise SystemExit(status)


def _status() -> int | str | None:
    try:
        app()
    except SystemExit as done:
        return done.code
    except BywireError as error:
        message(f"error: {error}")
        return error.exit_status
    except KeyboardInterrupt:
        message("interrupted")
        return INTERRUPTED
    except OSError as error:
        message(f"error: {error}")
        return FAILED
    except Exception:
        # Python's own status for this, 1, would read as a requirement that is not met.
        traceback.print_exc()
        message("error: this is a defect of bywire; please report it with the lines above")
        return FAILED
    return 0
