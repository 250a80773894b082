"""The commands of ``bywire``: those of all use cases, and a few others."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import redirect_stdout
from functools import cache
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from bywire.cli import completion
from bywire.cli.output import INTERRUPTED, message, result
from bywire.cli.show import JsonFlag, show
from bywire.cli.use_case_commands import command_of
from bywire.core.errors import InputError, ParameterError
from bywire.core.interrupts import interrupt_handled
from bywire.server.address import PORT
from bywire.usecases import use_cases


def list_command(
    name: Annotated[
        str | None,
        typer.Argument(
            metavar="[TOPIC|NAME|WORD]",
            help="A topic; or a name, to show its options, signals, units; or a word to search.",
            autocompletion=completion.names_of(),
        ),
    ] = None,
    json: JsonFlag = False,
) -> None:
    """List topics, the names of a topic, or all about a name."""
    from bywire.api.overview import is_topic, overview

    if name is None or is_topic(name):
        show(lambda _: overview(name or ""), as_json=json)
        return
    from bywire.api.describe import describe

    show(lambda _: describe(name), as_json=json)


def benchmark_command(
    parts: Annotated[
        list[str] | None,
        typer.Argument(metavar="[PART]...", help="What to measure, e.g. commands; by default all."),
    ] = None,
    json: JsonFlag = False,
) -> None:
    """Measure speed against hand-written C and other simulators."""
    show(lambda progress: _benchmarks().measure(progress, parts or ()), as_json=json)


def _benchmarks() -> ModuleType:
    """Load the benchmarks, which are next to ``src`` in a clone of the repository.

    Raises
    ------
    InputError
        If bywire does not run from a clone.
    """
    clone = Path(__file__).parents[3]
    if not (clone / "benchmarks" / "suite.py").is_file():
        raise InputError(
            "the benchmarks need a clone of bywire's repository: run python3 tasks.py demo there, "
            "then .venv/bin/bywire benchmark"
        )
    sys.path.insert(0, str(clone))
    return import_module("benchmarks.suite")


# --- serve


def serve_command(
    subject: Annotated[
        Path | None,
        typer.Argument(
            metavar="[BENCH|FOLDER]",
            show_default=False,
            autocompletion=completion.names_of(
                "experiments", "generic_experiments", ending=".toml"
            ),
            help="Bench file, experiment or folder; the current folder by default.",
        ),
    ] = None,
    port: Annotated[int, typer.Option(help="Port; 0 for any free port.")] = PORT,
    folder: Annotated[
        Path | None,
        typer.Option(
            help="Folder to serve; by default the folder of the bench file.", show_default=False
        ),
    ] = None,
) -> None:
    """Show and run benches and studies in a browser on this machine, with their results."""
    from bywire.server.serving import serve

    def say(link: str) -> None:
        message("open this link in a browser on this machine; Ctrl-C ends the server")
        result(link)

    try:
        serve(subject or "", port=port, folder=folder or "", say=say)
    except KeyboardInterrupt:  # typer would exit without a message
        interrupt_handled()
        message("interrupted")
        raise typer.Exit(INTERRUPTED) from None


# --- All commands

_SIZE = "size"


class StudyGroup(TyperGroup):
    """Commands of studies; the name of a sizing study stands for ``size NAME``."""

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:  # types of typer's own click
        """Return the command of the first word; see click."""
        if args and args[0].endswith(".toml"):
            raise ParameterError(f"to run a study file, type 'bywire study run {args[0]}'")
        if args and not args[0].startswith("-") and args[0] not in self.commands:
            args = [_SIZE, *args]
        return super().resolve_command(ctx, args)


# --- The commands

_ORDER = """
list, run, compare, page, serve, reproduce, benchmark, linearize, frequency-response, agreement,
margins, life, faults, design, convert, identify, replay, check, new,
study run, study resume, study extend, study report, study status, study surrogate, study size,
export controller, export fmu, export wasm
"""
"""commands in the order of the help; any others follow"""
_GROUPS: dict[str, dict[str, Any]] = {
    "study": {
        "cls": StudyGroup,
        "help": "Run a study of many cases (run FILE), or compare designs of a brake (NAME).",
    },
    "export": {"help": "Export parts of a bench for other tools."},
}
"""groups of commands, by their first word"""


@cache
def program() -> Any:
    """Return the command line as a callable of its arguments, built once."""
    found = typer.main.get_command(app())
    _keep_brackets(found)
    return found


def app() -> typer.Typer:
    """Return the commands as a typer application."""
    made = typer.Typer(
        name="bywire",
        help="A virtual test bench for brake-by-wire actuators.",
        no_args_is_help=True,
        pretty_exceptions_enable=False,
        context_settings={"help_option_names": ["-h", "--help"]},
    )
    made.callback(invoke_without_command=True)(_root)
    groups = {word: typer.Typer(no_args_is_help=True, **more) for word, more in _GROUPS.items()}
    order = [words.strip() for words in _ORDER.split(",")]
    found = dict(_commands())
    for words in sorted(found, key=lambda words: order.index(words) if words in order else 99):
        group, _, name = words.rpartition(" ")
        groups.get(group, made).command(name)(found[words])
    for word, members in groups.items():
        made.add_typer(members, name=word)
    return made


def _keep_brackets(command: Any) -> None:
    """Make help show brackets, as in ``Pressure [bar]``, which Rich would take for markup."""
    for option in command.params:
        if getattr(option, "help", None):
            option.help = option.help.replace("[", r"\[")
    for inner in getattr(command, "commands", {}).values():
        _keep_brackets(inner)


def _commands() -> Iterator[tuple[str, Callable[..., None]]]:
    """Yield every command with the words after ``bywire``."""
    yield "list", list_command
    yield "serve", serve_command
    yield "benchmark", benchmark_command
    for case in use_cases().values():
        for command in case.commands:
            yield command.words, command_of(case, command)


def _root(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version", help="Print the version.")] = False,
    system: Annotated[
        list[str] | None,
        typer.Option(
            "--system",
            metavar="PATH",
            help="Load your own brake, a file or a package; bywire executes its code. "
            "Before or after the command.",
        ),
    ] = None,
) -> None:
    if version:
        from bywire.core.version import __version__

        result(__version__)
        raise typer.Exit
    if system:
        from bywire.core.brake import load_system

        with redirect_stdout(sys.stderr):  # output of its code is not a result
            for path in system:
                load_system(path)
        if context.invoked_subcommand is None:
            result(context.get_help())
