"""The commands of ``bywire``, in the order of the help."""

from __future__ import annotations

import sys
from contextlib import redirect_stdout
from functools import cache
from typing import Annotated, Any

import typer

from bywire.cli.bench_commands import (
    benchmark_command,
    list_command,
    reproduce_command,
    run,
)
from bywire.cli.brake_commands import check_command, new_command
from bywire.cli.compare_command import compare
from bywire.cli.data_commands import convert
from bywire.cli.export_commands import export_app
from bywire.cli.fault_commands import faults_command
from bywire.cli.identification_commands import identify, replay
from bywire.cli.life_command import life_command
from bywire.cli.loop_commands import (
    agreement_command,
    frequency_response_command,
    linearize_command,
    margins_command,
)
from bywire.cli.output import result
from bywire.cli.page_command import page_command
from bywire.cli.serve_command import serve_command
from bywire.cli.sizing_commands import design_command, study_command
from bywire.cli.study_commands import study_app

app = typer.Typer(
    name="bywire",
    help="A virtual test bench for brake-by-wire actuators.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
app.command("list")(list_command)
app.command("run")(run)
app.command("compare")(compare)
app.command("page")(page_command)
app.command("serve")(serve_command)
app.command("reproduce")(reproduce_command)
app.command("benchmark")(benchmark_command)
app.command("linearize")(linearize_command)
app.command("frequency-response")(frequency_response_command)
app.command("agreement")(agreement_command)
app.command("margins")(margins_command)
study_app.command("size")(study_command)
app.add_typer(study_app, name="study")
app.command("life")(life_command)
app.command("faults")(faults_command)
app.command("design")(design_command)
app.add_typer(export_app, name="export")
app.command("convert")(convert)
app.command("identify")(identify)
app.command("replay")(replay)
app.command("check")(check_command)
app.command("new")(new_command)


@cache
def program() -> Any:
    """Return the command line, called with its arguments: its options are read off once."""
    found = typer.main.get_command(app)
    _keep_brackets(found)
    return found


def _keep_brackets(command: Any) -> None:
    """Have help show brackets, as in ``Pressure [bar]``, which Rich would take for markup."""
    for option in command.params:
        if getattr(option, "help", None):
            option.help = option.help.replace("[", r"\[")
    for inner in getattr(command, "commands", {}).values():
        _keep_brackets(inner)


@app.callback(invoke_without_command=True)
def _root(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version", help="Print the version.")] = False,
    system: Annotated[
        list[str] | None,
        typer.Option(
            "--system",
            metavar="PATH",
            help="Load a brake of your own, a file or a package; its code is run. "
            "Before or behind the command.",
        ),
    ] = None,
) -> None:
    if version:
        from bywire.core.version import __version__

        result(__version__)
        raise typer.Exit
    if system:
        from bywire.core.brake import load_system

        with redirect_stdout(sys.stderr):  # what its code prints is no result
            for path in system:
                load_system(path)
        if context.invoked_subcommand is None:
            result(context.get_help())
