"""All errors that bywire raises on purpose.

::

    BywireError
    ├── InputError                exit status 2: the user's input is wrong
    │   ├── ParameterError        a value outside its range, a missing or contradictory value
    │   ├── UnitError             a quantity whose unit does not fit
    │   ├── UnknownNameError      a name that does not exist
    │   ├── FileError             a file that cannot be read, understood or written
    │   ├── ModelError            a model that violates the protocol
    │   └── StepError             steps and sample times that do not divide each other
    └── RunError                  exit status 3: the computation failed
        ├── SolverError           a trajectory that diverged or did not settle
        ├── WorkLimitError        a run that exceeds its work limit
        ├── CompilerError         a compiler that failed on a generated kernel
        └── DeviceError           a graphics processor that is missing, full or failed
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from copy import copy
from datetime import date, time
from difflib import SequenceMatcher, get_close_matches
from typing import Any, Self, TypeVar

from bywire.core.clean_text import shortened

E = TypeVar("E", bound="BywireError")

_SHOWN = 60  # characters of a value in a message
_MOST = 12  # names in a list
_FEW = 3  # names that begin like an unknown name, which come first in suggestions
_NEAR = 0.7  # minimum similarity of a suggestion in an error that lists all names
_BARE_KEY = re.compile(r"[\w-]+", re.ASCII)


class BywireError(Exception):
    """Base of all errors that bywire raises on purpose: text for the user, fields for programs.

    Parameters
    ----------
    text
        What is wrong with the value, what is valid, and what to type.
    name
        Name as the user writes it: a parameter, an option, a key, a column, a path.
    value
        Value of the name, as it appears in the text.
    valid
        Valid values: a range with its unit, or the nearest names.
    """

    exit_status = 3

    def __init__(self, text: str = "", *, name: str = "", value: str = "", valid: str = "") -> None:
        super().__init__(text)
        self.name, self.value, self.valid = name, value, valid

    def __str__(self) -> str:
        return shortened(super().__str__())

    def at(self, place: str, kind: type[E]) -> E:
        """Return an error of another kind with the same fields, and a place in front of the text.

        Examples
        --------
        >>> error = unknown_name("state", "v", ["omega"]).at("Spindle.motor", ModelError)
        >>> print(error)
        Spindle.motor: unknown state 'v': valid names are omega
        """
        return kind(f"{place}: {self}", name=self.name, value=self.value, valid=self.valid)

    def reworded(self, text: str) -> Self:
        """Return the same error with another text, for example with the file's name in front.

        Examples
        --------
        >>> error = not_valid("motor.R_m", "-3 ohm", "> 0 ohm")
        >>> longer = error.reworded(f"step.toml: {error}")
        >>> print(longer)
        step.toml: motor.R_m = -3 ohm is not valid: it must be > 0 ohm
        >>> longer.name, longer.value, longer.valid
        ('motor.R_m', '-3 ohm', '> 0 ohm')
        """
        other = copy(self)
        other.args = (text,)
        return other


class InputError(BywireError):
    """The user's input is wrong."""

    exit_status = 2


class ParameterError(InputError):
    """A value outside its range, or values that contradict each other."""


class UnitError(InputError):
    """A quantity whose unit does not fit."""


class UnknownNameError(InputError):
    """A name that does not exist."""


class FileError(InputError):
    """A file that cannot be read, understood or written."""


class ModelError(InputError):
    """A model that violates the protocol."""


class StepError(InputError):
    """Steps and sample times that do not divide each other."""


class RunError(BywireError):
    """The computation failed."""


class SolverError(RunError):
    """A trajectory that diverged or did not settle."""


class WorkLimitError(RunError):
    """A run that exceeds its work limit."""


class CompilerError(RunError):
    """A compiler that failed on a generated kernel."""


class DeviceError(RunError):
    """A graphics processor that is missing, full or failed."""


def place_of(thing: Any) -> str:
    """Return file and line of a class or function, or its name if they are unknown."""
    from inspect import getsourcefile, getsourcelines

    try:
        return f"{getsourcefile(thing)}, line {getsourcelines(thing)[1]}"
    except (OSError, TypeError):  # typed into a console
        return str(getattr(thing, "__qualname__", thing))


def not_valid(
    name: str,
    value: str,
    valid: str,
    advice: str = "",
    kind: type[InputError] = ParameterError,
) -> InputError:
    """Build the error for a value that is out of range or of the wrong type.

    Parameters
    ----------
    name
        Name as the user writes it.
    value
        Value with its unit.
    valid
        Valid values, to end the sentence "it must be ...".
    advice
        Next step, if it is not obvious.
    kind
        Class of the error.

    Examples
    --------
    >>> print(not_valid("threads", "0", ">= 1"))
    threads = 0 is not valid: it must be >= 1
    >>> print(not_valid("band", "600 Hz", "<= 500 Hz", "half the loop's rate"))
    band = 600 Hz is not valid: it must be <= 500 Hz, half the loop's rate
    """
    text = f"{name} = {value} is not valid: it must be {valid}{advice and f', {advice}'}"
    return kind(text, name=name, value=value, valid=valid)


def unknown_name(
    kind: str, name: str, known: Iterable[str], first: Iterable[str] = (), listed: str = ""
) -> UnknownNameError:
    """Build the error for an unknown name, with the nearest known names.

    Parameters
    ----------
    kind
        Kind of the name, for example ``"experiment"``.
    name
        Name that the user wrote.
    known
        All valid names.
    first
        Names that come first in the list.
    listed
        Command that lists all names, if there are too many for the error.
    """
    every, leading = {*known}, sorted(first)
    others = sorted(every.difference(leading))
    candidates = [*leading, *(by_likeness(others, [name]) if len(every) > _MOST else others)]
    begun = [each for each in candidates if name and each.startswith(name)]
    alike = get_close_matches(name, candidates, n=3, cutoff=0.5)
    close = list(dict.fromkeys([*begun, *alike] if len(begun) <= _FEW else alike))[:3]
    hint = f"did you mean {', '.join(map(repr, close))}?" if close else _listing(candidates)
    if listed and not close and len(candidates) > _MOST:
        hint = f"{hint} ({listed!r} shows all)"
    text = f"unknown {kind} {quoted(name)}: {hint}"
    return UnknownNameError(text, name=kind, value=name, valid=", ".join(close or candidates))


def unknown_of_few(kind: str, name: str, known: Iterable[str]) -> UnknownNameError:
    """Build the error for an unknown name, with the nearest and all valid names.

    It is for names of which only a few are valid. They keep their order. For the parameters, see
    `unknown_name`.

    Examples
    --------
    >>> print(unknown_of_few("key", "desing", ["vary", "design"]))
    unknown key 'desing': did you mean 'design'? Valid names are vary, design
    >>> print(unknown_of_few("key", "frequency", ["vary", "design"]))
    unknown key 'frequency': valid names are vary, design
    """
    every = list(known)
    near = get_close_matches(name, every, n=1, cutoff=_NEAR)
    hint = f"did you mean {near[0]!r}? Valid" if near else "valid"
    text = f"unknown {kind} {quoted(name)}: {hint} names are {_shown(every)}"
    return UnknownNameError(text, name=kind, value=name, valid=", ".join(every))


def nearest_first(
    names: Iterable[str], requested: Iterable[str], units: Mapping[str, str] | None = None
) -> str:
    """Return a short list of names for an error, starting with those most like the requested names.

    ``units``: unit of each name, which the list shows next to the name.

    Examples
    --------
    >>> nearest_first(["time", "p_caliper", "i_set"], ["p_set", "i_set"])
    'i_set, p_caliper, time'
    """
    ordered = by_likeness(names, list(requested))
    return _shown(ordered if units is None else [f"{name} [{units[name]}]" for name in ordered])


def by_likeness(names: Iterable[str], aims: list[str]) -> list[str]:
    """Return names in the order of their likeness to one of some others, ignoring case."""

    def distance(name: str) -> float:
        near = (SequenceMatcher(None, name.casefold(), aim.casefold()).ratio() for aim in aims)
        return -max(near, default=0.0)

    return sorted(names, key=distance)


def quoted(value: object) -> str:
    """Return a value for an error in TOML notation, on one line, shortened if long.

    Examples
    --------
    >>> quoted("9 mm"), quoted([1, True])
    ("'9 mm'", '[1, true]')
    """
    if isinstance(value, int) and value.bit_length() > 1000:
        return "a number of 300 digits or more"  # Python cannot convert the longest numbers to text
    if isinstance(value, str):
        return repr(value if len(value) <= _SHOWN else f"{value[:_SHOWN]}...")
    try:
        text = _as_toml(value)
    except (ValueError, RecursionError):  # such a number in a list, or a thousand nested lists
        return f"a {type(value).__name__}"
    return text if len(text) <= _SHOWN else f"{text[:_SHOWN]}..."


def counted(count: int, noun: str) -> str:
    """Return a count with its noun in the singular or plural.

    Examples
    --------
    >>> counted(1, "sample"), counted(2, "sample")
    ('1 sample', '2 samples')
    """
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


def _as_toml(value: object) -> str:
    """Return a value in TOML notation, or in Python notation if TOML has none."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, (date, time)):
        return value.isoformat()
    if type(value) is list:
        return f"[{', '.join(map(_as_toml, value))}]"
    if type(value) is dict:
        each = (f"{_key(str(k))} = {_as_toml(v)}" for k, v in value.items())
        return f"{{ {', '.join(each)} }}" if value else "{}"
    return repr(value)


def _key(name: str) -> str:
    return name if _BARE_KEY.fullmatch(name) else repr(name)


def _listing(candidates: list[str]) -> str:
    return f"valid names are {_shown(candidates)}" if candidates else "no names are defined here"


def _shown(names: list[str]) -> str:
    more = f" and {len(names) - _MOST} more" if len(names) > _MOST else ""
    return ", ".join(names[:_MOST]) + more
