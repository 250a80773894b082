"""Lines such as ``motor.R_m=0.4 ohm``, as commands and forms take them."""

from __future__ import annotations

from collections.abc import Iterable

from bywire.core.errors import ParameterError


def named(texts: Iterable[str] | None, flag: str) -> dict[str, str]:
    """Return what an option ``NAME`` or ``NAME=TEXT`` names, with an empty text by default.

    Raises
    ------
    ParameterError
        For what names nothing, and names that are given twice.
    """
    values: dict[str, str] = {}
    for text in texts or ():
        name, equals, value = (part.strip() for part in text.partition("="))
        if not name or (equals and not value):
            raise ParameterError(f"{flag} {text}: write NAME, or NAME=TEXT")
        if name in values:
            raise ParameterError(f"{flag} {text}: {name} is given twice: leave one of them out")
        values[name] = value
    return values


def changes(texts: Iterable[str] | None, flag: str = "--set") -> dict[str, str]:
    """Return what ``--set KEY=VALUE``, or another such option, asks for.

    Raises
    ------
    ParameterError
        For what is no KEY=VALUE, and keys that are set twice.
    """
    values: dict[str, str] = {}
    for text in texts or ():
        key, equals, value = (part.strip() for part in text.partition("="))
        if not equals or not key or not value:
            raise ParameterError(f"{flag} {text}: write KEY=VALUE, for instance motor.R_m=0.4ohm")
        if key in values:
            raise ParameterError(f"{flag} {text}: {key} is set twice: leave one of them out")
        values[key] = value
    return values
