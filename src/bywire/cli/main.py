"""The command ``bywire``.

This module loads fast, so that Ctrl-C works from the start. ``app`` imports the modules that
commands need.
"""

from __future__ import annotations

import atexit
import errno
import gc
import os
import signal
import sys
import traceback
import warnings
from collections import namedtuple
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from bywire.cli.output import INTERRUPTED, flush, message, open_streams
from bywire.core.child_process import leave_out_working_folder
from bywire.core.errors import BywireError, ModelError, ParameterError
from bywire.core.interrupts import interrupts_noted
from bywire.core.libraries import keep_one_thread, leave_out_dask, silence_matplotlib
from bywire.core.machine import address_space

FAILED = 3
GARBAGE = 50_000
"""objects between two garbage collections; with Python's 700, a short run takes 10 % longer"""


def process() -> None:
    """Run the command line in this process, and exit without Python's finalization.

    Finalization after all output would take a sixth of a warm run's time. After Ctrl-C, a library's
    thread that is still running might abort the finalization. Functions registered with ``atexit``
    still run.
    """
    from bywire.core.sources import command

    status: list[object] = []

    def leave() -> None:
        if status:
            flush()
            os._exit(status[0] if isinstance(status[0], int) else 0)

    atexit.register(leave)  # registered first, therefore called last
    leave_out_working_folder()
    leave_out_dask()
    silence_matplotlib()
    keep_one_thread()
    try:
        with command():  # a program that calls ``main`` may have changed functions
            main()
    except SystemExit as done:
        if done.code is None or isinstance(done.code, int):
            status.append(done.code)
        raise


def main() -> None:
    """Run the command line, and turn user errors into one message and an exit status."""
    from bywire.core.callers import command_line

    # All output is written before finalization, during which Ctrl-C would kill the process.
    atexit.register(signal.signal, signal.SIGINT, signal.SIG_IGN)
    gc.set_threshold(GARBAGE, *gc.get_threshold()[1:])
    open_streams()
    try:
        with interrupts_noted() as was_interrupted, command_line():
            status = _status(was_interrupted)
            flush()
    except KeyboardInterrupt:  # before the first output, or during the last
        message("interrupted")
        status = INTERRUPTED
    # If a KeyboardInterrupt hits text that CPython executes, as for a named tuple, CPython records
    # it as unhandled and later kills ``python -m`` with the signal. Another named tuple resets
    # this.
    namedtuple("Reset", ())
    raise SystemExit(status)


def _system_error(error: OSError) -> str:
    """Return the operating system's error with its path and a remedy."""
    reason = error.strerror or str(error) or type(error).__name__
    place = f"{error.filename}: " if error.filename else ""
    if error.errno in (errno.ENOSPC, errno.EDQUOT):
        return f"{place}{reason}. Free some space, or choose another folder with --out or TMPDIR"
    return (
        f"{place}{reason}. Check that it exists and that you have permission to read and write it"
    )


def _foreign_line(error: Exception) -> str:
    """Return an error and its line if a user's brake raised it, otherwise an empty text."""
    from bywire.core.brake import foreign_line

    return foreign_line(error)


def _path_of(rest: Iterator[str]) -> str:
    path = next(rest, "")
    if not path:
        raise ParameterError(
            "--system needs the path of a Python file or of a folder with __init__.py",
            name="--system",
            valid="a Python file or a folder",
        )
    return path


def systems_first(arguments: Sequence[str]) -> list[str]:
    """Move every ``--system PATH`` before the command.

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


def _status(was_interrupted: Callable[[], bool]) -> int | str | None:
    """Return the exit status, 130 after Ctrl-C even if a library converts the interrupt."""
    try:
        status = _warned()
    except BaseException as error:
        if not (was_interrupted() or isinstance(error, KeyboardInterrupt)):
            return _explained(error)
        status = None
    is_new = status is None or was_interrupted()
    if is_new and status != INTERRUPTED:
        message("interrupted")
        return INTERRUPTED
    return status


_OURS = ("BrakeWarning", "MeasurementWarning")


def _warned() -> int | str:
    """Run the command, and print a brake's warnings as messages."""
    with warnings.catch_warnings():
        show_otherwise = warnings.showwarning

        def show(text: Warning | str, category: type[Warning], *place: Any) -> None:
            if category.__name__ in _OURS:  # by name, because their modules may not be loaded
                message(f"warning: {text}")
            else:
                show_otherwise(text, category, *place)

        setattr(warnings, "showwarning", show)  # noqa: B010 - its type requires the exact names
        from bywire.cli.app import program

        try:
            status = program()(systems_first(sys.argv[1:]), standalone_mode=False)
        except SystemExit as done:
            return done.code or 0
        except Exception as error:
            # Typer's usage errors, whose module differs between its versions.
            if not hasattr(error, "format_message"):
                raise
            return _misused(error)
        return status if isinstance(status, int) else 0


def _misused(error: Any) -> int:
    """Print one line about a usage error, and return the exit status."""
    text = error.format_message().strip().rstrip(".")
    if "\n" in text:
        error.show()  # the help of a command group
    elif text:  # without a text, the help is already printed
        context = getattr(error, "ctx", None)
        command = context.command_path if context is not None else "bywire"
        name = f"{words}: " if (words := command.partition(" ")[2]) else ""
        if "unexpected extra argument" in text:
            text += '. Put a value that contains a space in quotation marks, as in "0.5 ohm"'
        if text.startswith("No such option: --require") and command.endswith(" run"):
            text += '. Use --set "requirements.NAME=<= LIMIT"'
        message(f"error: {name}{text[0].lower()}{text[1:]}. For help, type '{command} -h'")
    return int(error.exit_code)


def _explained(error: BaseException) -> int:
    """Print an error's message, and return the exit status."""
    if isinstance(error, BywireError):
        message(f"error: {error}")
        return error.exit_status
    if isinstance(error, MemoryError):
        limit = address_space()
        why = (
            f"The address space of this process is limited to {limit / 2**30:.3g} GiB. Raise the "
            f"limit "
            "with ulimit -v"
            if limit
            else "Free some memory, or reduce the number of cases or workers"
        )
        message(f"error: out of memory. {why}")
        return FAILED
    if isinstance(error, OSError):
        message(f"error: {_system_error(error)}")
        return FAILED
    foreign = _foreign_line(error) if isinstance(error, Exception) else ""
    if foreign:
        message(f"error: {foreign}")
        return ModelError.exit_status
    # Python would exit with status 1, which here means that a requirement is not met.
    traceback.print_exception(error)
    message("error: this is a bug in bywire. Please report it with the lines above")
    return FAILED
