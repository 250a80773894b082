"""All commands of ``bywire``: one or more for each use case, and a few others."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Iterator
from contextlib import redirect_stdout
from functools import cache
from importlib import import_module
from inspect import Parameter, Signature
from pathlib import Path
from types import ModuleType
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from bywire.cli import completion
from bywire.cli.output import INTERRUPTED, message, result
from bywire.cli.show import ANOTHER, JsonFlag, VerboseFlag, folder, show
from bywire.core.errors import InputError, ParameterError
from bywire.core.interrupts import interrupt_handled
from bywire.core.pairs import changes, named
from bywire.server.address import PORT
from bywire.usecases import use_cases
from bywire.usecases.asks import OUT
from bywire.usecases.declare import Argument, Command, UseCase

_REPEATED = ("changes", "lines", "names", "pairs")  # flags that the user may repeat


def command_of(case: UseCase, command: Command) -> Callable[..., None]:
    """Return a use case's command as a function for typer."""
    arguments = [a for a in case.arguments if a.name not in command.without]

    def run(**given: Any) -> None:
        as_json, verbose = given.pop("json"), given.pop("verbose")
        out = given.pop("out", None)
        asked = {a.name: _read(a, given[a.name]) for a in arguments if a.name != "out"}
        if command.before is not None:
            command.before(**asked, out=out)
        if out is None and command.default_folder is not None:
            out = command.default_folder(**asked)
        written = out if command.writes == "out" else asked.get(command.writes)
        more = {} if out is None else {"out": out}
        show(
            lambda progress: case.call({**asked, **more}, progress=progress),
            written,
            as_json,
            command.advice or ANOTHER,
            verbose,
        )

    run.__doc__ = help_of(case, command)
    asked = sorted(arguments, key=lambda a: (a.ask.is_last, a.name not in command.first))
    asked.sort(key=lambda a: command.first.index(a.name) if a.name in command.first else 99)
    parameters = [_parameter(a.name, *_typer(a, command)) for a in asked]
    if command.writes == "out" and not any(a.name == "out" for a in asked):
        parameters.append(_parameter("out", *_folder(OUT, None)))
    parameters.append(_parameter("verbose", VerboseFlag, False))
    parameters.append(_parameter("json", JsonFlag, False))
    setattr(run, "__signature__", Signature(parameters))  # noqa: B010
    run.__annotations__ = {each.name: each.annotation for each in parameters}
    return run


def help_of(case: UseCase, command: Command) -> str:
    """Return a command's help, including the meaning of exit status 1 if it has one."""
    text = command.help or case.summary
    if not command.status_1:
        return text
    return f"{text} Exits with status 1 {command.status_1}."


def _parameter(name: str, kind: Any, default: Any) -> Parameter:
    return Parameter(name, Parameter.KEYWORD_ONLY, annotation=kind, default=default)


def _typer(argument: Argument, command: Command) -> tuple[Any, Any]:
    """Return an argument's type and default for typer."""
    ask, kind, default = argument.ask, argument.kind, argument.default
    if ask.is_folder:
        return _folder(ask, default)
    help = command.required.get(argument.name, ask.help)
    more: dict[str, Any] = {"help": help, "metavar": ask.metavar, "min": ask.least}
    more |= {"autocompletion": _completed(ask), "rich_help_panel": ask.panel}
    if ask.shown_default is not None:
        more["show_default"] = ask.shown_default
    is_required = argument.is_required or argument.is_many or argument.name in command.required
    if is_required:
        default, more["show_default"] = Parameter.empty, False
    elif kind in _REPEATED:
        default = "" if ask.is_listing else None
    taken = _taken(argument, is_required)
    if argument.is_positional:
        return Annotated[taken, typer.Argument(**more)], default
    # Typer creates two flags for a bool with default True, unless one is specified.
    flags = [] if kind == "flag" and default is True else [argument.flag]
    return Annotated[taken, typer.Option(*flags, **more)], default


def _taken(argument: Argument, is_required: bool) -> Any:
    """Return the type to which typer converts the user's text."""
    if argument.kind == "lines" and argument.ask.is_listing:
        return str
    if argument.kind in _REPEATED:
        return list[str] | None
    if argument.kind in ("things", "files"):
        return list[Path] if is_required else list[Path] | None
    if argument.kind == "flag":
        return bool
    if argument.kind == "whole":
        return int if is_required or isinstance(argument.default, int) else int | None
    if argument.is_path:
        return Path if is_required else Path | None
    return str


def _folder(ask: Any, default: Any) -> tuple[Any, Any]:
    shown: dict[str, Any] = {} if default is None else {"show_default": False}
    option = typer.Option("--out", help=ask.help, parser=folder, metavar="PATH", **shown)
    if default is Parameter.empty:
        return Annotated[Path, option], default
    return Annotated[Path | None, option], None


def _completed(ask: Any) -> Callable[..., completion.Completed] | None:
    if ask.completes:
        return completion.changeable if ask.completes == "changes" else completion.varied
    return completion.names_of(*ask.known, ending=ask.files) if ask.known else None


def _read(argument: Argument, value: Any) -> Any:
    """Convert typer's value to the type that the function accepts."""
    if argument.kind in ("changes", "pairs"):
        return changes(value, argument.flag)
    if argument.kind == "names":
        return named(value, argument.flag)
    if argument.ask.is_listing:
        return _listed(value, argument)
    return value or () if argument.kind in ("lines", "files") else value


def _listed(text: str, argument: Argument) -> Any:
    """Split at commas, except those within brackets, as in ``ans(2,:)``."""
    if text == "nothing" and argument.default is None:
        return []
    parts = [part.strip() for part in re.split(r",(?![^(\[]*[)\]])", text)]
    return [part for part in parts if part] or argument.default


# --- The program


def list_command(
    name: Annotated[
        str | None,
        typer.Argument(
            metavar="[TOPIC|NAME|WORD]",
            help="Topic, name or search word. For a name, the output shows its options, signals "
            "and units.",
            autocompletion=completion.names_of(),
        ),
    ] = None,
    json: JsonFlag = False,
) -> None:
    """List all topics, the names in a topic, or the details of a name."""
    from bywire.api.overview import is_topic, overview

    if name is None or is_topic(name):
        show(lambda _: overview(name or ""), as_json=json)
        return
    from bywire.api.describe import describe

    show(lambda _: describe(name), as_json=json)


def benchmark_command(
    parts: Annotated[
        list[str] | None,
        typer.Argument(metavar="[PART]...", help="Benchmark to run, e.g. commands. Default: all."),
    ] = None,
    json: JsonFlag = False,
) -> None:
    """Measure bywire's speed against hand-written C and other simulators."""
    show(lambda progress: _benchmarks().measure(progress, parts or ()), as_json=json)


def _benchmarks() -> ModuleType:
    """Load the benchmarks from a folder next to ``src`` in a clone of the repository.

    Raises
    ------
    InputError
        If bywire is not running from a clone.
    """
    clone = Path(__file__).parents[3]
    if not (clone / "benchmarks" / "suite.py").is_file():
        raise InputError(
            "bywire is not running from a clone of its repository, which contains the benchmarks. "
            "In a clone, run 'python3 tasks.py demo' and then '.venv/bin/bywire benchmark'"
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
            help="Bench file, experiment or folder. Default: the current folder.",
        ),
    ] = None,
    port: Annotated[int, typer.Option(help="Port of the server. 0 selects a free port.")] = PORT,
    folder: Annotated[
        Path | None,
        typer.Option(help="Folder to serve. Default: the bench file's folder.", show_default=False),
    ] = None,
) -> None:
    """Run benches and studies in a browser on this machine, and view their results."""
    from bywire.server.serving import serve

    def say(link: str) -> None:
        message("open this link in a browser on this machine. Press Ctrl-C to stop the server")
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
    """Commands for studies. The name of a sizing study alone is short for ``size NAME``."""

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:  # types of typer's own click
        """Return the command for the first word (see click)."""
        if args and args[0].endswith(".toml"):
            raise ParameterError(
                f"{args[0]} is not a command of 'bywire study'. To run this study file, type "
                f"'bywire study run {args[0]}'",
                name="study",
                value=args[0],
                valid=f"bywire study run {args[0]}",
            )
        if args and not args[0].startswith("-") and args[0] not in self.commands:
            args = [_SIZE, *args]
        return super().resolve_command(ctx, args)


# --- The commands

_ORDER = """
list, run, compare, page, serve, reproduce, benchmark, linearize, frequency-response, agreement,
margins, life, procedure, faults, signoff, design, convert, identify, replay, check, new,
study run, study resume, study extend, study report, study status, study surrogate, study size,
export controller, export fmu, export wasm
"""
"""commands that the help lists first, in this order"""
_GROUPS: dict[str, dict[str, Any]] = {
    "study": {
        "cls": StudyGroup,
        "help": "Run a study with many cases (run FILE), or compare brake designs (size NAME).",
    },
    "export": {"help": "Export a bench, or parts of it, for other tools."},
}
"""groups of commands, by their first word"""


@cache
def program() -> Any:
    """Return the command line as a callable, built once."""
    found = typer.main.get_command(app())
    _keep_brackets(found)
    return found


def app() -> typer.Typer:
    """Return all commands as a typer application."""
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
    """Make help show brackets as in ``Pressure [bar]``, which Rich would treat as markup."""
    for option in command.params:
        if getattr(option, "help", None):
            option.help = option.help.replace("[", r"\[")
    for inner in getattr(command, "commands", {}).values():
        _keep_brackets(inner)


def _commands() -> Iterator[tuple[str, Callable[..., None]]]:
    """Yield every command and the words to type after ``bywire``."""
    yield "list", list_command
    yield "serve", serve_command
    yield "benchmark", benchmark_command
    for case in use_cases().values():
        for command in case.commands:
            yield command.words, command_of(case, command)


def _root(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version", help="Print the version and exit.")] = False,
    system: Annotated[
        list[str] | None,
        typer.Option(
            "--system",
            metavar="PATH",
            help="Load your own brake from a Python file or package. bywire executes its code. "
            "Can come before or after the command.",
        ),
    ] = None,
) -> None:
    if version:
        from bywire.core.version import __version__

        result(__version__)
        raise typer.Exit
    if system:
        from bywire.core.brake import load_system

        with redirect_stdout(sys.stderr):  # its own output is not a result
            for path in system:
                load_system(path)
        if context.invoked_subcommand is None:
            result(context.get_help())
