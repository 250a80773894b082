"""The command ``bywire``."""

from __future__ import annotations

import gc
import sys
import traceback
import warnings
from collections.abc import Iterator, Sequence
from contextlib import redirect_stdout
from typing import Annotated, Any

import typer

from bywire.cli.bench_commands import (
    benchmark_command,
    list_command,
    reproduce_command,
    run,
)
from bywire.cli.brake_commands import check_command, new_command
from bywire.cli.data_commands import convert
from bywire.cli.identification_commands import identify, replay
from bywire.cli.loop_commands import (
    agreement_command,
    frequency_response_command,
    linearize_command,
    margins_command,
)
from bywire.cli.output import flush, message, open_streams, result
from bywire.cli.show import INTERRUPTED
from bywire.cli.sizing_commands import design_command, study_command
from bywire.core.errors import BywireError, ModelError, ParameterError

FAILED = 3
GARBAGE = 50_000
"""objects between two searches for garbage; Python's 700 make a short run a tenth longer"""

app = typer.Typer(
    name="bywire",
    help="A virtual test bench for brake-by-wire actuators.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
# In the order of the help.
app.command("list")(list_command)
app.command("run")(run)
app.command("reproduce")(reproduce_command)
app.command("benchmark")(benchmark_command)
app.command("linearize")(linearize_command)
app.command("frequency-response")(frequency_response_command)
app.command("agreement")(agreement_command)
app.command("margins")(margins_command)
app.command("study")(study_command)
app.command("design")(design_command)
app.command("convert")(convert)
app.command("identify")(identify)
app.command("replay")(replay)
app.command("check")(check_command)
app.command("new")(new_command)


@app.callback(invoke_without_command=True)
def _root(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version", help="Print the version.")] = False,
    system: Annotated[
        list[str] | None,
        typer.Option(
            "--system", metavar="PATH",
            help="Load a brake of your own, a file or a package; its code is run. "
            "Before or behind the command.",
        ),
    ] = None,
) -> None:  # fmt: skip
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


def main() -> None:
    """Run the command line; errors meant for the user become one message and an exit status."""
    from bywire.core.sources import command

    gc.set_threshold(GARBAGE, *gc.get_threshold()[1:])
    open_streams()
    with command():
        status = _status()
    flush()
    raise SystemExit(status)


def _foreign_line(error: Exception) -> str:
    """Return an error with its line if it is one of a brake that is not ours; else nothing."""
    from bywire.core.brake import foreign_line

    return foreign_line(error)


def _path_of(rest: Iterator[str]) -> str:
    path = next(rest, "")
    if not path:
        raise ParameterError("--system needs a PATH: a Python file, or a folder with __init__.py")
    return path


def systems_first(arguments: Sequence[str]) -> list[str]:
    """Return arguments with every ``--system PATH`` in front of the command.

    Examples
    --------
    >>> systems_first(["run", "step", "--system", "axis.py", "--json"])
    ['--system', 'axis.py', 'run', 'step', '--json']
    """
    front: list[str] = []
    behind: list[str] = []
    rest = iter(arguments)
    for each in rest:
        if each == "--":
            return [*front, *behind, each, *rest]
        if each == "--system":
            front += [each, _path_of(rest)]
        elif each.startswith("--system="):
            front.append(each)
        else:
            behind.append(each)
    return [*front, *behind]


def _status() -> int | str | None:
    with warnings.catch_warnings():
        show_otherwise = warnings.showwarning

        def show(text: Warning | str, category: type[Warning], *place: Any) -> None:
            if category.__name__ == "BrakeWarning":  # its module is loaded only where brakes are
                message(f"warning: {text}")
            else:
                show_otherwise(text, category, *place)

        setattr(warnings, "showwarning", show)  # noqa: B010 - its type wants the very names
        return _run(sys.argv[1:])


def _run(arguments: Sequence[str]) -> int | str | None:
    try:
        app(systems_first(arguments))
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
    except Exception as error:
        foreign = _foreign_line(error)
        if foreign:
            message(f"error: {foreign}")
            return ModelError.exit_status
        # Python's own status for this, 1, would read as a requirement that is not met.
        traceback.print_exc()
        message("error: this is a defect of bywire; please report it with the lines above")
        return FAILED
    return 0
