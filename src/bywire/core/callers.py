"""Messages in the words of their reader: flags of a command, or arguments of a Python function.

A message names an argument by `option`. The use case declares which flag stands for it; see
`bywire.usecases`.
"""

from __future__ import annotations

import json
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager

_commands: list[None] = []
_flags: dict[str, str] = {}


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


def flags() -> dict[str, str] | None:
    """Return the flags that messages name, for a process that helps with a command."""
    return dict(_flags) if _commands else None


def speak_in(flags: dict[str, str] | None) -> None:
    """Have this process word its messages as the one that started it does, see `flags`."""
    if flags is not None:
        _flags.update(flags)
        _commands.append(None)


def name_flag(argument: str, flag: str) -> None:
    """Declare which flag stands for an argument: the same one in every command.

    Raises
    ------
    ValueError
        When the argument has another flag in another command.
    """
    if _flags.setdefault(argument, flag) != flag:
        raise ValueError(
            f"argument {argument!r} has the flag {_flags[argument]} already, not {flag}"
        )


def option(argument: str, value: str | bool | dict[str, str] | None = None) -> str:
    """Return how the reader of a message writes an argument, with a value where one is given.

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
    ...     option("overrides", {"parameters": "NAME"}), option("force", True)
    ('--set parameters=NAME', '--force')
    """
    if is_command_line():
        flag = _flags.get(argument, f"--{argument.replace('_', '-')}")
        words = [f"{key}={each}" for key, each in value.items()] if isinstance(value, dict) else []
        return " ".join([flag, *words, *([value] if isinstance(value, str) else [])])
    if value is None:
        return argument
    return f"{argument}={value if value is True else json.dumps(value)}"


# --- Warnings, which a command, a job or a process of a study tells in its own words

_FOR_DEVELOPERS = (
    DeprecationWarning,
    PendingDeprecationWarning,
    ImportWarning,
    ResourceWarning,
)
"""hidden by Python by default, because a user can do nothing about them"""


@contextmanager
def heard_warnings() -> Iterator[list[warnings.WarningMessage]]:
    """Yield a list to which every warning is added until the block ends, each time it is given.

    Those for developers are left out, unless whoever started Python asked for warnings.
    """
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        for category in () if sys.warnoptions else _FOR_DEVELOPERS:
            warnings.simplefilter("ignore", category)
        yield caught
