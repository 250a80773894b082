"""Every error that bywire raises on purpose.

::

    BywireError
    ├── InputError                exit status 2: something the user gave is wrong
    │   ├── ParameterError        a value outside its range, a missing or contradictory value
    │   ├── UnitError             a quantity whose unit does not fit
    │   ├── UnknownNameError      a name that nothing answers to
    │   ├── FileError             a file that cannot be read, understood or written
    │   ├── ModelError            a model that does not give what the protocol asks for
    │   └── StepError             steps and sample times that do not divide each other
    └── RunError                  exit status 3: the computation failed
        ├── SolverError           a trajectory that left the numbers or did not settle
        ├── CompilerError         a compiler that failed on a generated kernel
        └── DeviceError           a graphics processor that is missing, full or failed
"""

from __future__ import annotations

from collections.abc import Iterable
from difflib import SequenceMatcher, get_close_matches
from typing import Any

from bywire.core.callers import in_callers_words

_SHOWN = 60  # characters of a value in a message


class BywireError(Exception):
    """Base of all errors raised on purpose; its text is meant for the user, see `callers`."""

    exit_status = 3

    def __str__(self) -> str:
        return in_callers_words(super().__str__())


class InputError(BywireError):
    """Something the user gave is wrong."""

    exit_status = 2


class ParameterError(InputError):
    """A value outside its range, or values that contradict each other."""


class UnitError(InputError):
    """A quantity whose unit does not fit the place where it stands."""


class UnknownNameError(InputError):
    """A name that nothing answers to."""


class FileError(InputError):
    """A file that cannot be read, understood or written."""


class ModelError(InputError):
    """A model that does not give what the protocol asks for."""


class StepError(InputError):
    """Steps and sample times that do not divide each other."""


class RunError(BywireError):
    """The computation failed."""


class SolverError(RunError):
    """A trajectory that left the numbers or did not settle."""


class CompilerError(RunError):
    """A compiler that failed on a generated kernel."""


class DeviceError(RunError):
    """A graphics processor that is missing, full or failed."""


def place_of(thing: Any) -> str:
    """Return file and line of a class or a function, or its name where nobody knows."""
    from inspect import getsourcefile, getsourcelines

    try:
        return f"{getsourcefile(thing)}, line {getsourcelines(thing)[1]}"
    except (OSError, TypeError):  # typed into a console
        return str(getattr(thing, "__qualname__", thing))


def unknown_name(
    kind: str, name: str, known: Iterable[str], first: Iterable[str] = ()
) -> UnknownNameError:
    """Build the error for an unknown name, with the nearest known ones.

    Parameters
    ----------
    kind
        What was looked for, for instance ``"experiment"``.
    name
        What the user wrote.
    known
        Every name that would have been accepted.
    first
        Those of them that a listing begins with.
    """
    every, leading = {*known}, sorted(first)
    candidates = [*leading, *sorted(every.difference(leading))]
    close = get_close_matches(name, candidates, n=3, cutoff=0.5)
    hint = f"did you mean {', '.join(map(repr, close))}?" if close else _listing(candidates)
    return UnknownNameError(f"unknown {kind} {quoted(name)}: {hint}")


def nearest_first(names: Iterable[str], wanted: Iterable[str]) -> str:
    """Return names as an error lists them: those that resemble what is wanted first, not all.

    Examples
    --------
    >>> nearest_first(["time", "p_caliper", "i_set"], ["p_set", "i_set"])
    'i_set, p_caliper, time'
    """
    aims = list(wanted)

    def distance(name: str) -> float:
        return -max((SequenceMatcher(None, name, aim).ratio() for aim in aims), default=0.0)

    return _shown(sorted(names, key=distance))


def quoted(value: object) -> str:
    """Return a value as an error quotes it: on one line, and cut off where it is long.

    Examples
    --------
    >>> quoted("9 mm"), quoted([1, 2])
    ("'9 mm'", '[1, 2]')
    """
    if isinstance(value, int) and value.bit_length() > 1000:
        return "a number of 300 digits or more"  # Python refuses to write the longest ones
    if isinstance(value, str):
        return repr(value if len(value) <= _SHOWN else f"{value[:_SHOWN]}...")
    try:
        text = repr(value)
    except (ValueError, RecursionError):  # such a number inside, or lists a thousand levels deep
        return f"a {type(value).__name__}"
    return text if len(text) <= _SHOWN else f"{text[:_SHOWN]}..."


def _listing(candidates: list[str]) -> str:
    return f"known are {_shown(candidates)}" if candidates else "none is known here"


def _shown(names: list[str]) -> str:
    return ", ".join(names[:12]) + (f" and {len(names) - 12} more" if len(names) > 12 else "")
