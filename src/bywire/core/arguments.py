"""Checks of a public function's arguments against its annotations, with one clear error."""

from __future__ import annotations

import inspect
import operator
import os
import reprlib
import sys
from collections.abc import Callable, Iterable, Mapping
from functools import cache, partial, wraps
from numbers import Real
from types import UnionType
from typing import Any, TypeVar, get_args

from bywire.core.errors import ParameterError, quoted

F = TypeVar("F", bound=Callable[..., Any])
_ONE = (str, bytes, Mapping)  # iterable, but not valid as a list
_LINES = reprlib.Repr()
_LINES.maxstring = _LINES.maxother = 60  # characters of a value in a message


def checked(function: F) -> F:
    """Make a function or data class reject arguments whose type its signature does not allow.

    Examples
    --------
    >>> @checked
    ... def doubled(value: float) -> float:
    ...     return 2.0 * value
    >>> doubled("64")
    Traceback (most recent call last):
        ...
    bywire.core.errors.ParameterError: value = '64' must be a number
    """
    if isinstance(function, type):
        made: Any = function
        made.__init__ = checked(made.__init__)
        return function

    @wraps(function)
    def checking(*args: Any, **kwargs: Any) -> Any:
        require_kinds(function, args, kwargs)
        return function(*args, **kwargs)

    return checking  # type: ignore[return-value]


def require_kinds(
    function: Callable[..., Any], args: tuple[Any, ...], kwargs: Mapping[str, Any]
) -> None:
    """Reject arguments whose type a function's signature does not allow.

    The function itself checks ranges, names and units.

    Parameters
    ----------
    function
        Function whose annotations are strings (``from __future__ import annotations``).
    args, kwargs
        Arguments of the call. Python itself rejects missing and unknown arguments.

    Raises
    ------
    ParameterError
        When an argument has the wrong type, with its name, its value, and the valid types.

    Examples
    --------
    >>> def drawn(cases: int | None = None) -> None: ...
    >>> drawn.__annotations__["cases"] = "int | None"   # as in a module that postpones them
    >>> require_kinds(drawn, (), {"cases": "64"})
    Traceback (most recent call last):
        ...
    bywire.core.errors.ParameterError: cases = '64' must be a whole number
    """
    names, expected = _signature(function)
    for name, value in (*zip(names, args, strict=False), *kwargs.items()):
        kinds = expected.get(name)
        if kinds and not any(fits(value) for _, fits in kinds):
            valid = " or ".join(dict.fromkeys(text for text, _ in kinds if text))
            shown = _LINES.repr(value)  # in Python notation instead of TOML notation
            text = f"{name} = {shown} must be {valid}"
            raise ParameterError(text, name=name, value=shown, valid=valid)


def whole_number(name: str, value: object, least: int, most: int) -> int:
    """Return a whole number within a range.

    Parameters
    ----------
    name
        Name of the number in errors.
    value
        Value to check. A truth value is not valid.
    least, most
        Bounds of the range, both valid.

    Raises
    ------
    ParameterError
        When the value is not a whole number within the range.
    """
    if not _is_whole(value) or not least <= operator.index(value) <= most:  # type: ignore[arg-type]
        raise ParameterError(
            f"{name} = {quoted(value)} must be a whole number from {least} to {most}",
            name=name,
            value=quoted(value),
            valid=f"from {least} to {most}",
        )
    return operator.index(value)  # type: ignore[arg-type]


_Kind = tuple[str, Callable[[Any], bool]]


@cache
def _signature(function: Callable[..., Any]) -> tuple[list[str], dict[str, list[_Kind]]]:
    """Return the names of positional arguments, and the kinds of each argument to check."""
    parameters = inspect.signature(function).parameters
    positional = [
        p.name
        for p in parameters.values()
        if p.kind in (p.POSITIONAL_ONLY, p.POSITIONAL_OR_KEYWORD)
    ]
    known = getattr(inspect.unwrap(function), "__globals__", {})
    kinds = {
        name: [_kind(part.strip(), known) for part in _parts(str(p.annotation))]
        for name, p in parameters.items()
        if p.kind not in (p.VAR_POSITIONAL, p.VAR_KEYWORD)
    }
    return positional, {
        name: [kind for kind in each if kind is not None]
        for name, each in kinds.items()
        if None not in each
    }


def _parts(annotation: str) -> list[str]:
    """Split an annotation at vertical bars outside brackets.

    Examples
    --------
    >>> _parts("Callable[[int | str], float] | None")
    ['Callable[[int | str], float] ', ' None']
    """
    parts, depth = [""], 0
    for sign in annotation:
        depth += (sign in "[(") - (sign in "])")
        if sign == "|" and not depth:
            parts.append("")
        else:
            parts[-1] += sign
    return parts


def _kind(part: str, known: Mapping[str, Any]) -> _Kind | None:
    """Return the description and the test for a part of an annotation; None if any value is valid.

    Parameters
    ----------
    part
        Name of a type, possibly with the types of its items in brackets.
    known
        Names in the function's module.
    """
    name = part.partition("[")[0]
    if name in _KINDS:
        return _KINDS[name]
    meant = known.get(name)
    if meant is None:  # the module imports the library only when the function is called
        meant = getattr(sys.modules.get("bywire"), name, None)
    if meant is None and name.startswith("xr."):
        return f"a {name[3:]}", partial(_is_of_xarray, name[3:])
    kinds = get_args(meant) if isinstance(meant, UnionType) else (meant,)
    if meant is Any or not all(isinstance(k, type) for k in kinds):
        return None
    if any(getattr(k, "_is_protocol", False) for k in kinds):
        return None
    names = [k.__name__ for k in kinds]
    words = " or ".join(f"a{'n' if each[0] in 'AEIOU' else ''} {each}" for each in names)
    return words, lambda value: isinstance(value, kinds)


def _is_of_xarray(name: str, value: object) -> bool:
    if getattr(value, "stands_for", "") == name:  # has the type's interface
        return True
    xarray = sys.modules.get("xarray")  # no value has xarray's type unless xarray is loaded
    return xarray is not None and isinstance(value, getattr(xarray, name))


def _is_whole(value: object) -> bool:
    try:
        operator.index(value)  # type: ignore[arg-type]
    except TypeError:
        return False
    return not isinstance(value, bool)


def _is_truth_value(value: object) -> bool:
    numpy = sys.modules.get("numpy")  # no value has NumPy's type unless NumPy is loaded
    return isinstance(value, bool if numpy is None else (bool, numpy.bool_))


def _are_numbers(value: object) -> bool:
    import numpy as np  # loading it takes as long as all other imports of a declaration

    try:
        array = np.asarray(value)
    except (TypeError, ValueError):
        return False
    return array.dtype.kind in "biufc"


_KINDS: dict[str, tuple[str, Callable[[Any], bool]]] = {
    "int": ("a whole number", _is_whole),
    "float": ("a number", lambda v: isinstance(v, Real) and not isinstance(v, bool)),
    "bool": ("True or False", _is_truth_value),
    "str": ("a string", lambda v: isinstance(v, str)),
    "Path": ("a path", lambda v: isinstance(v, os.PathLike)),
    "Mapping": ("a mapping of names to values", lambda v: isinstance(v, Mapping)),
    "Sequence": (
        "a list",
        lambda v: isinstance(v, Iterable) and not isinstance(v, _ONE),
    ),
    "Progress": ("a function of a label and the finished fraction", callable),
    "Callable": ("a function", callable),
    "tuple": ("a tuple", lambda v: isinstance(v, Iterable) and not isinstance(v, _ONE)),
    "type": ("a class", lambda v: isinstance(v, type)),
    "Array": ("numbers", _are_numbers),
    "None": ("", lambda v: v is None),
}
