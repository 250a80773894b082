"""Arguments of public functions, by what their signatures say: one clear error for a wrong kind."""

from __future__ import annotations

import inspect
import operator
import os
import reprlib
from collections.abc import Callable, Iterable, Mapping
from functools import cache
from numbers import Real
from typing import Any

import numpy as np

from bywire.core.errors import ParameterError, quoted

_LINES = reprlib.Repr()
_LINES.maxstring = _LINES.maxother = 60  # characters of a value in a message


def require_kinds(
    function: Callable[..., Any], args: tuple[Any, ...], kwargs: Mapping[str, Any]
) -> None:
    """Refuse arguments that are of another kind than a function's signature says.

    Ranges, names and units are for the function itself; so is whatever has a type of our own.

    Parameters
    ----------
    function
        Function, whose annotations are texts (``from __future__ import annotations``).
    args, kwargs
        What it is called with. Missing and unknown arguments are left to Python.

    Raises
    ------
    ParameterError
        With the argument's name and value, and what is wanted.

    Examples
    --------
    >>> def drawn(cases: int | None = None) -> None: ...
    >>> drawn.__annotations__["cases"] = "int | None"  # as a module has it that postpones them
    >>> require_kinds(drawn, (), {"cases": "64"})
    Traceback (most recent call last):
        ...
    bywire.core.errors.ParameterError: cases = '64': a whole number is wanted
    """
    names, wanted = _signature(function)
    for name, value in (*zip(names, args, strict=False), *kwargs.items()):
        kinds = wanted.get(name, ())
        if kinds and not any(_KINDS[kind][1](value) for kind in kinds):
            said = " or ".join(_KINDS[kind][0] for kind in kinds if kind != "None")
            given = _LINES.repr(value)  # as Python has it, and not as a file
            raise ParameterError(f"{name} = {given}: {said} is wanted")


def whole_number(name: str, value: object, least: int, most: int) -> int:
    """Return a whole number within a range.

    Parameters
    ----------
    name
        What it is called.
    value
        What was given; a truth value is no number.
    least, most
        Ends of the range.

    Raises
    ------
    ParameterError
        For anything else.
    """
    if not _is_whole(value) or not least <= operator.index(value) <= most:  # type: ignore[arg-type]
        raise ParameterError(
            f"{name} = {quoted(value)}: a whole number from {least} to {most} is wanted"
        )
    return operator.index(value)  # type: ignore[arg-type]


@cache
def _signature(function: Callable[..., Any]) -> tuple[list[str], dict[str, list[str]]]:
    """Return the names of positional arguments, and the kinds of each that can be checked."""
    parameters = inspect.signature(function).parameters
    positional = [
        p.name for p in parameters.values()
        if p.kind in (p.POSITIONAL_ONLY, p.POSITIONAL_OR_KEYWORD)
    ]  # fmt: skip
    kinds = {
        name: [part.partition("[")[0].strip() for part in str(p.annotation).split(" | ")]
        for name, p in parameters.items()
    }
    return positional, {name: each for name, each in kinds.items() if {*each} <= {*_KINDS}}


def _is_whole(value: object) -> bool:
    try:
        operator.index(value)  # type: ignore[arg-type]
    except TypeError:
        return False
    return not isinstance(value, bool)


_KINDS: dict[str, tuple[str, Callable[[Any], bool]]] = {
    "int": ("a whole number", _is_whole),
    "float": ("a number", lambda v: isinstance(v, Real) and not isinstance(v, bool)),
    "bool": ("True or False", lambda v: isinstance(v, (bool, np.bool_))),
    "str": ("a text", lambda v: isinstance(v, str)),
    "Path": ("a path", lambda v: isinstance(v, os.PathLike)),
    "Mapping": ("a mapping of names to values", lambda v: isinstance(v, Mapping)),
    "Sequence": (
        "a list",
        lambda v: isinstance(v, Iterable) and not isinstance(v, (str, bytes, Mapping)),
    ),
    "Progress": ("a function of a label and the finished share", callable),
    "None": ("", lambda v: v is None),
}
