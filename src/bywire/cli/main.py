"""The command ``bywire``."""

from __future__ import annotations

import traceback
from typing import Annotated

import typer

from bywire.cli.bench_commands import (
    benchmark,
    list_command,
    reproduce,
    run,
)
from bywire.cli.brake_commands import check_command
from bywire.cli.data_commands import convert
from bywire.cli.identification_commands import identify, replay
from bywire.cli.loop_commands import (
    agreement_command,
    frequency_response_command,
    linearize_command,
    margins_command,
)
from bywire.cli.options import INTERRUPTED
from bywire.cli.output import flush, message, open_streams, result
from bywire.cli.sizing_commands import design_command, study_command
from bywire.core.errors import BywireError

FAILED = 3

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
app.command("reproduce")(reproduce)
app.command("benchmark")(benchmark)
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


@app.callback(invoke_without_command=True)
def _root(
    version: Annotated[bool, typer.Option("--version", help="Print the version.")] = False,
) -> None:
    if version:
        from bywire.core.version import __version__

        result(__version__)
        raise typer.Exit


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
