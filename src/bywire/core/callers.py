"""Wording of messages for their reader, with a command's flags or a Python function's arguments.

A message refers to an argument with `option`. The use case declares the corresponding flag; see
`bywire.usecases`.
"""

from __future__ import annotations

import json
import re
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager

_PLAIN = re.compile(r"[\w.=@:,+%/-]*")
_commands: list[None] = []
_flags: dict[str, str] = {}


@contextmanager
def command_line() -> Iterator[None]:
    """Use flags in messages until the block ends, because a person typed a command."""
    _commands.append(None)
    try:
        yield
    finally:
        _commands.pop()


def is_command_line() -> bool:
    """Return whether a person typed a command, or a program called a function."""
    return bool(_commands)


def flags() -> dict[str, str] | None:
    """Return the flags for messages, to pass to a command's worker processes; None in Python."""
    return dict(_flags) if _commands else None


def use_flags(flags: dict[str, str] | None) -> None:
    """Word this process's messages like those of its parent; see `flags`."""
    if flags is not None:
        _flags.update(flags)
        _commands.append(None)


def name_flag(argument: str, flag: str) -> None:
    """Declare an argument's flag, which is the same in every command.

    Raises
    ------
    ValueError
        When the argument has another flag in another command.
    """
    if _flags.setdefault(argument, flag) != flag:
        raise ValueError(
            f"argument {argument!r} already has the flag {_flags[argument]}, not {flag}"
        )


def option(argument: str, value: str | bool | dict[str, str] | None = None) -> str:
    """Return an argument in the notation of the message's reader, with its value if it has one.

    Parameters
    ----------
    argument
        Name in the function's signature.
    value
        A word, ``True``, or a name with its value.

    Examples
    --------
    >>> name_flag("overrides", "--set")
    >>> option("overrides"), option("overrides", {"parameters": "NAME"}), option("force", True)
    ('overrides', 'overrides={"parameters": "NAME"}', 'force=True')
    >>> with command_line():
    ...     option("overrides", {"options.p_to": "30 bar"}), option("force", True)
    ('--set "options.p_to=30 bar"', '--force')
    """
    if is_command_line():
        flag = _flags.get(argument, f"--{argument.replace('_', '-')}")
        pairs = value.items() if isinstance(value, dict) else ()
        if pairs:
            return " ".join(f"{flag} {_as_word(f'{key}={each}')}" for key, each in pairs)
        return f"{flag} {value}" if isinstance(value, str) else flag
    if value is None:
        return argument
    return f"{argument}={value if value is True else json.dumps(value)}"


def _as_word(text: str) -> str:
    """Return one word of a command line, in quotation marks that every usual shell accepts."""
    return text if '"' in text or _PLAIN.fullmatch(text) else f'"{text}"'


# --- Warnings, which a command, a job or a study's process shows in its own way

_FOR_DEVELOPERS = (
    DeprecationWarning,
    PendingDeprecationWarning,
    ImportWarning,
    ResourceWarning,
)
"""categories that Python hides by default, because users cannot act on them"""


@contextmanager
def collected_warnings() -> Iterator[list[warnings.WarningMessage]]:
    """Yield a list that collects all warnings until the block ends, including repeated warnings.

    It excludes warnings for developers, unless Python was started with options for warnings.
    """
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        for category in () if sys.warnoptions else _FOR_DEVELOPERS:
            warnings.simplefilter("ignore", category)
        yield caught
