"""Page of all commands with their arguments and options, from their help."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

from bywire.cli.app import program
from site_pages.markdown import plain, table_lines


def commands() -> dict[str, Any]:
    """Return the words that a user types -> the command; subcommands replace their group."""
    return dict(_leaves("bywire", program()))


def _leaves(words: str, command: Any) -> Iterator[tuple[str, Any]]:
    if hasattr(command, "commands"):
        for name, inner in command.commands.items():
            yield from _leaves(f"{words} {name}", inner)
    else:
        yield words, command


def page() -> str:
    """Return the page of commands."""
    lines = [
        "# Commands",
        "",
        "Each command calls a public function, with the same checks and warnings. `bywire COMMAND "
        "--help` prints the same text. Add `--system PATH` to use your own brake with any command. "
        "The [](../cheat-sheet.md) lists all commands on one page.",
        "",
    ]
    for words, command in commands().items():
        context = command.make_context(words, [], resilient_parsing=True)
        usage = re.sub(r"\s+", " ", command.get_usage(context).removeprefix("Usage: "))
        lines += [f"## {words}", "", f"`{usage}`", "", *_help(command.help or ""), ""]
        lines += table_lines(["", "meaning"], _rows(command, context))
    return "\n".join(lines)


def _help(text: str) -> Iterator[str]:
    for paragraph in text.replace("\b", "").split("\n\n"):
        yield from (plain(paragraph), "")


def _rows(command: Any, context: Any) -> Iterator[list[str]]:
    for each in command.get_params(context):
        if (record := each.get_help_record(context)) is not None:
            name, said = record
            yield [f"`{name.replace('|', '/')}`", plain(said)]
