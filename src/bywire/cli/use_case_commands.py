"""Commands generated from the declarations of use cases."""

from __future__ import annotations

import re
from collections.abc import Callable
from inspect import Parameter, Signature
from pathlib import Path
from typing import Annotated, Any

import typer

from bywire.cli import completion
from bywire.cli.show import ANOTHER, JsonFlag, VerboseFlag, folder, show
from bywire.core.pairs import changes, named
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
