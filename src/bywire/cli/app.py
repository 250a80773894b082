"""The commands of ``bywire``: those of all use cases, and a few by hand."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import redirect_stdout
from functools import cache
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from bywire.cli.bench_commands import benchmark_command, list_command
from bywire.cli.output import result
from bywire.cli.serve_command import serve_command
from bywire.cli.use_case_commands import command_of
from bywire.core.errors import ParameterError
from bywire.usecases import use_cases

_SIZE = "size"


class StudyGroup(TyperGroup):
    """Commands of studies; the name of a sizing study stands for ``size NAME``."""

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:  # types of typer's own click
        """Return the command of the first word; see click."""
        if args and args[0].endswith(".toml"):
            raise ParameterError(f"a study file is run by 'bywire study run {args[0]}'")
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
"""commands in the order of the help; others follow"""
_GROUPS: dict[str, dict[str, Any]] = {
    "study": {
        "cls": StudyGroup,
        "help": "Run a study of many cases (run FILE), or compare designs of a brake (NAME).",
    },
    "export": {"help": "Write parts of a bench in the form that other tools take."},
}
"""groups of commands, by the first of their words"""


@cache
def program() -> Any:
    """Return the command line, called with its arguments: its options are read off once."""
    found = typer.main.get_command(app())
    _keep_brackets(found)
    return found


def app() -> typer.Typer:
    """Return the commands as typer has them."""
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
    """Have help show brackets, as in ``Pressure [bar]``, which Rich would take for markup."""
    for option in command.params:
        if getattr(option, "help", None):
            option.help = option.help.replace("[", r"\[")
    for inner in getattr(command, "commands", {}).values():
        _keep_brackets(inner)


def _commands() -> Iterator[tuple[str, Callable[..., None]]]:
    """Yield every command with the words behind ``bywire``."""
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
