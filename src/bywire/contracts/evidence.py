"""Evidence for a contract: outcome, measure, and place in the code."""

from __future__ import annotations

import inspect
import math
import re
import traceback
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from types import ModuleType
from typing import Any, Literal


class NotCheckedError(Exception):
    """Reason why a contract cannot be checked."""


@dataclass(frozen=True)
class Place:
    """Line of a file; line 0 means the whole file."""

    file: str
    line: int

    def __str__(self) -> str:
        return f"{self.file}:{self.line}" if self.line else self.file


@dataclass(frozen=True)
class Evidence:
    """Evidence for or against a contract.

    Parameters
    ----------
    holds
        Whether the subject meets the contract.
    text
        Text of the finding, with choices or signal.
    figure, limit
        Measure and its limit; None if the contract has none.
    place
        Line to inspect, if it is not the subject's line.
    is_error
        Whether an error prevented the check.
    """

    holds: bool
    text: str
    figure: float | None = None
    limit: float | None = None
    place: Place | None = None
    is_error: bool = False


def measured(figure: float, limit: float, text: str, place: Place | None = None) -> Evidence:
    """Return evidence that holds if a measure is at most its limit; NaN never holds."""
    return Evidence(bool(figure <= limit), text, float(figure), limit, place)


def worst(evidence: Iterable[Evidence]) -> Evidence:
    """Return the first evidence that does not hold, or the evidence that is nearest its limit."""
    nearest: Evidence | None = None
    for each in evidence:
        if not each.holds:
            return each
        if nearest is None or _share(each) > _share(nearest):
            nearest = each
    return nearest or Evidence(True, "nothing to check")


def _share(evidence: Evidence) -> float:
    if evidence.figure is None or evidence.limit is None:
        return -1.0
    return evidence.figure / evidence.limit if evidence.limit else math.inf


Contract = Callable[[Any], Evidence | Iterator[Evidence]]
"""one rule for a subject (function, module, class, model)"""


def examine(contract: Contract, subject: Any, place: Place | None = None) -> Evidence:
    """Return the evidence for a contract; an error in the subject's equations breaks the contract.

    Parameters
    ----------
    place
        Place of the subject, if it is not the place of its code.

    Raises
    ------
    NotCheckedError
        When the contract cannot be checked.
    """
    try:
        evidence = contract(subject)
        return evidence if isinstance(evidence, Evidence) else worst(evidence)
    except NotCheckedError:
        raise
    except Exception as error:  # a user's equations may raise any error
        text = " ".join(str(error).split())
        at = place or place_of(subject)
        said = f"{type(error).__name__}: {text}"
        return Evidence(False, said, place=_raised_at(error, at.file), is_error=True)


def place_of(subject: Any) -> Place:
    """Return the place of a function, a class or a module in the code."""
    if isinstance(subject, ModuleType):
        return Place(subject.__file__ or subject.__name__, 0)
    subject = inspect.unwrap(subject) if callable(subject) else type(subject)
    try:
        return Place(inspect.getsourcefile(subject) or "?", _source(subject)[1])
    except (OSError, TypeError):
        return Place(getattr(subject, "__module__", "?"), 0)


@lru_cache(maxsize=1024)
def _source(subject: Any) -> tuple[list[str], int]:
    """Return the lines of a function or class; for a class, Python parses the whole file."""
    return inspect.getsourcelines(subject)


def field_place(cls: type[Any], name: str) -> Place:
    """Return the line on which a class declares a field, or the line of the class."""
    at = place_of(cls)
    declaring: Any = cls
    try:
        lines, first = _source(declaring)
    except (OSError, TypeError):
        return at
    declaration = re.compile(rf"\s+{re.escape(name)}\s*:")
    places = (Place(at.file, first + k) for k, line in enumerate(lines) if declaration.match(line))
    return next(places, at)


def _raised_at(error: Exception, file: str) -> Place | None:
    """Return the innermost line in the subject's folder at which an error was raised."""
    folder = Path(file).parent
    lines = [
        Place(frame.filename, frame.lineno or 0)
        for frame in traceback.extract_tb(error.__traceback__)
        if Path(frame.filename).parent == folder
    ]
    return lines[-1] if lines else None


# --- Findings: one line per subject and contract

Outcome = Literal["holds", "broken", "not checked"]


@dataclass(frozen=True)
class Finding:
    """Finding for one contract of one subject.

    Parameters
    ----------
    subject
        Function, class, parameter set or model, for example ``"plant.dc_motor.balance"``.
    contract
        Name of the contract, for example ``"units"``.
    outcome
        ``holds``, ``broken``, or ``not checked``.
    text
        Text of the finding, or the reason why the contract was not checked.
    figure, limit
        Measure and its limit; None if the contract has none.
    place
        Line to inspect.
    is_error
        Whether an error of the subject prevented the check.
    """

    subject: str
    contract: str
    outcome: Outcome
    text: str
    place: Place
    figure: float | None = None
    limit: float | None = None
    is_error: bool = False

    def __str__(self) -> str:
        return f"{self.subject}: {self.contract}: {self.outcome}: {self.text} ({self.place})"


@dataclass(frozen=True)
class Demand:
    """Contract of a named subject."""

    name: str
    subject: str
    on: Any
    contract: Contract
    place: Place | None = None

    def settle(self) -> Finding:
        """Check the contract and return the finding."""
        place = self.place or place_of(self.on)
        try:
            evidence = examine(self.contract, self.on, place)
        except NotCheckedError as reason:
            return Finding(self.subject, self.name, "not checked", str(reason), place)
        outcome: Outcome = "holds" if evidence.holds else "broken"
        return Finding(
            self.subject,
            self.name,
            outcome,
            evidence.text,
            evidence.place or place,
            evidence.figure,
            evidence.limit,
            evidence.is_error,
        )


def one_by_cause(findings: Iterable[Finding]) -> Iterator[Finding]:
    """Yield findings in order, with each error once and its repetitions marked as not checked.

    For example, a renamed parameter causes the same error in all checks of a model.
    """
    seen: dict[tuple[str, Place], Finding] = {}
    for each in findings:
        first = seen.setdefault((each.text, each.place), each) if each.is_error else each
        if first is each:
            yield each
        else:
            text = f"the error of {first.subject}: {first.contract} also occurs here"
            yield replace(each, outcome="not checked", text=text)


Demands = Iterator[Demand]
