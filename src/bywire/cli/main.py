"""The command ``bywire``."""

from __future__ import annotations

import sys
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any

import typer

from bywire.core.errors import BywireError, ParameterError

INTERRUPTED = 130

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
    Path | None, typer.Option("--out", help="Folder for recordings, figures and the report.")
]


# Each command loads what it needs when it runs, so that `bywire --help` stays quick.
def _command(name: str) -> Any:
    return import_module(f"bywire.cli.{name}").execute


@app.command("list")
def list_command(json: JsonFlag = False) -> None:
    """Show assemblies, parameter sets, experiments, stimuli and KPIs."""
    _command("list_command")(json)


@app.command()
def run(
    bench: Annotated[Path, typer.Argument(help="Bench file (TOML).", show_default=False)],
    set_: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="KEY=VALUE", help="Change the bench, e.g. motor.R_m=0.4ohm."),
    ] = None,
    out: OutFolder = None,
    json: JsonFlag = False,
) -> None:
    """Run a bench file; exit status 1 when a requirement is not met."""
    raise typer.Exit(_command("run_command")(bench, _changes(set_ or []), out, json))


@app.command()
def reproduce(
    source: Annotated[str, typer.Argument(help="Published source, e.g. dardanelli2010.")],
    out: OutFolder = None,
    json: JsonFlag = False,
) -> None:
    """Make a paper's tables and figures: stated, computed, agrees or not."""
    _command("reproduce_command")(source, out, json)


@app.command()
def benchmark(json: JsonFlag = False) -> None:
    """Measure speed against hand-written C and what users would pick instead."""
    _command("benchmark_command")(json)


@app.callback(invoke_without_command=True)
def _root(
    version: Annotated[bool, typer.Option("--version", help="Print the version.")] = False,
) -> None:
    if version:
        from bywire import __version__

        print(__version__)
        raise typer.Exit


def _changes(texts: list[str]) -> dict[str, str]:
    changes = {}
    for text in texts:
        key, equals, value = text.partition("=")
        if not equals or not key.strip():
            raise ParameterError(f"--set {text}: write KEY=VALUE, for instance motor.R_m=0.4ohm")
        changes[key.strip()] = value.strip()
    return changes


def main() -> None:
    """Run the command line; errors meant for the user become one message and an exit status."""
    try:
        app()
    except BywireError as error:
        print(f"bywire: error: {error}", file=sys.stderr)
        raise SystemExit(error.exit_status) from None
    except KeyboardInterrupt:
        print("bywire: interrupted", file=sys.stderr)
        raise SystemExit(INTERRUPTED) from None
    except BrokenPipeError:
        sys.stderr.close()
        raise SystemExit(0) from None
