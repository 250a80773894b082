"""Messages in the words of who called: flags on the command line, arguments in Python.

Messages are written once, with the flags of the command. Where a program called, what it reads
names the argument that stands for the flag.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager

_ARGUMENTS = {
    "set": "overrides",
    "input": "inputs",
    "output": "outputs",
    "unknown": "unknowns",
    "prior": "priors",
    "estimate-start": "states",
    "option": "options",
    "map": "mapping",
    "tolerance": "tolerances",
    "out": "folder",
    "force": "force=True",
    "dither": "dither=True",
    "schedule": "schedule=True",
    "study": "bywire.trust, with count",
}
"""flags whose arguments are called otherwise"""
_WORDS = re.compile(
    r"(?P<command>\bbywire [a-z-]+(?: [^\s',;:)]+)*)"  # a command that is quoted stays one
    r"|(?P<system>--system PATH, or )"
    r"|(?<![\w-])--(?P<pair>set|input|option|prior) (?P<key>[\w.*]+)=(?P<value>[^\s,;)]+)"
    r"|(?<![\w-])--(?P<text>side) (?P<side>[^\s,;]+)"
    r"|(?<![\w-])--(?P<flag>[a-z]+(?:-[a-z]+)*)"
)
_commands: list[None] = []


@contextmanager
def command_line() -> Iterator[None]:
    """Have messages name flags until the block ends: a person typed a command."""
    _commands.append(None)
    try:
        yield
    finally:
        _commands.pop()


def is_command_line() -> bool:
    """Return whether a person typed a command, and no program called."""
    return bool(_commands)


def in_callers_words(text: str) -> str:
    """Return a message with the arguments of Python's functions in place of flags, in a program.

    Examples
    --------
    >>> in_callers_words("say for which, with --set parameters=NAME, or leave out --over")
    'say for which, with overrides={"parameters": "NAME"}, or leave out over'
    """
    return text if _commands or "--" not in text else _WORDS.sub(_argument, text)


def _argument(match: re.Match[str]) -> str:
    if match["command"]:
        return match["command"]
    if match["system"]:
        return ""
    if match["pair"]:
        return f'{_ARGUMENTS[match["pair"]]}={{"{match["key"]}": "{match["value"]}"}}'
    if match["text"]:
        return f'{match["text"]}="{match["side"]}"'
    return _ARGUMENTS.get(match["flag"], match["flag"].replace("-", "_"))
