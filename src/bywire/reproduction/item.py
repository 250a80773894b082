"""Statements of a source compared with our results, and root causes of disagreements."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import Literal

from bywire.bench.requirements import COMPARE
from bywire.core.arguments import checked
from bywire.report.wording import amount

Tolerance = float | Literal["<=", ">="]
Kind = Literal["printed", "reading", "axis", "requirement", "physical bound", "ours"]
"""kind of a statement: a number in text, table or equation; a sentence that we interpret as a
number; the end of a figure's axis; a requirement on the design; a physical limit that we derive; or
our result without a statement"""


SHARE = "share"
"""unit of an allowance that is a fraction of the stated number"""


@checked
@dataclass(frozen=True)
class Allowance:
    """A tolerance with its reason.

    Parameters
    ----------
    what
        Compared quantity.
    size
        Maximum difference that is treated as agreement.
    unit
        Unit of ``size``, or `SHARE`.
    reason
        Reason for this size.
    """

    what: str
    size: float
    unit: str
    reason: str

    def around(self, stated: float) -> float:
        """Return the tolerance around a stated number, in that number's unit."""
        return self.size * abs(stated) if self.unit == SHARE else self.size


@dataclass(frozen=True)
class Fact:
    """A number in a source with its place, or a physical bound on it.

    Parameters
    ----------
    value
        The number in ``unit``, as printed.
    unit
        Unit as the source prints it; ``"1"`` for a pure number.
    where
        Place in the source.
    kind
        Kind of the statement.
    tolerance
        Tolerance for the verdict (see `Item`), or an `Allowance` around the number; None if there
        is none.
    note
        Computation of its counterpart, if it is the same for all sets.
    """

    value: float
    unit: str
    where: str
    kind: Kind = "printed"
    tolerance: Tolerance | Allowance | None = None
    note: str = ""


def reading(value: float, unit: str, where: str) -> Fact:
    """Return a sentence of a source as a number; ``where`` contains its interpretation."""
    return Fact(value, unit, where, "reading")


@dataclass(frozen=True)
class Item:
    """A statement of a source with our result.

    Parameters
    ----------
    id
        Name of the statement, followed by ``@`` and the parameter set unless it is the main one.
    unit
        Unit of all numbers, as the source prints it.
    stated, computed
        The two numbers; None if missing.
    tolerance
        Maximum difference that is treated as agreement; ``"<="`` or ``">="`` if the statement is a
        bound on the computed number; None without a verdict.
    agrees
        None if the source states nothing, or if the value was tuned to the statement.
    note
        Place of the statement, and remarks for the reader.
    kind
        Kind of the statement.
    """

    id: str
    unit: str
    stated: float | None
    computed: float | None
    tolerance: Tolerance | None
    agrees: bool | None
    note: str
    kind: Kind = "ours"

    @property
    def parameter_set(self) -> str:
        """Text after ``@`` in the id; empty for the main set."""
        return self.id.partition("@")[2]


@checked
def compared(
    name: str,
    fact: Fact,
    computed: float,
    tolerance: Tolerance | Allowance | Literal["as stated"] | None = "as stated",
    note: str = "",
    *,
    tuned: Literal["", "calibrated", "an input"] = "",
) -> Item:
    """Return a statement with our result and the verdict from its tolerance.

    Parameters
    ----------
    name
        The item's id.
    fact
        The statement.
    computed
        Our result in the fact's unit; NaN agrees with nothing.
    tolerance
        See `Item`; an `Allowance` applies around the stated number. ``"as stated"``: the fact's.
    note
        Remark for the reader, after the place of the statement and the note of the fact.
    tuned
        Way in which the value was made to agree. Such a statement proves nothing and has no
        verdict.
    """
    if tolerance == "as stated":
        tolerance = fact.tolerance
    if isinstance(tolerance, Allowance):
        tolerance = tolerance.around(fact.value)
    agrees = None if tuned or tolerance is None else holds(fact.value, computed, tolerance)
    note = _joined((fact.where, tuned, fact.note, note))
    return Item(name, fact.unit, fact.value, computed, tolerance, agrees, note, fact.kind)


@checked
def found(name: str, unit: str, computed: float, note: str) -> Item:
    """Return a number that the source does not state.

    Parameters
    ----------
    name, unit, computed, note
        As in `Item`.
    """
    return Item(name, unit, None, computed, None, None, note)


def quoted(name: str, fact: Fact, note: str) -> Item:
    """Return a statement without our result.

    Parameters
    ----------
    name, fact, note
        As in `compared`.
    """
    note = _joined((fact.where, note))
    return Item(name, fact.unit, fact.value, None, None, None, note, fact.kind)


def holds(stated: float, computed: float, tolerance: Tolerance) -> bool:
    """Return whether a computed number agrees with a stated one; NaN never does."""
    if isinstance(tolerance, str):
        return bool(COMPARE[tolerance](computed, stated))
    return abs(computed - stated) <= tolerance


def _joined(parts: tuple[str, ...]) -> str:
    return "; ".join(part for part in parts if part)


# --- Root causes


@dataclass(frozen=True)
class RootCause:
    """A cause of disagreements.

    Parameters
    ----------
    text
        The cause with its numbers, in a few sentences.
    explains
        Ids of the statements that it explains; ``*`` matches anything.
    is_within_source
        Whether the source contradicts itself or a law of physics, so that its statements cannot all
        be true. Otherwise, bywire's model contradicts the source.
    """

    text: str
    explains: tuple[str, ...]
    is_within_source: bool = False

    def explained(self, items: Iterable[Item]) -> list[Item]:
        """Return the disagreements that the cause explains."""
        return [
            item
            for item in items
            if item.agrees is False and any(fnmatchcase(item.id, name) for name in self.explains)
        ]


class Quoted:
    """Numbers of the items, as text with unit."""

    def __init__(self, items: Iterable[Item]) -> None:
        self._items = {item.id: item for item in items}

    def stated(self, name: str) -> str:
        """Return the stated number with its unit."""
        item = self._items[name]
        return amount(item.stated, item.unit, 3)

    def __call__(self, name: str) -> str:
        """Return the computed number with its unit."""
        item = self._items[name]
        return amount(item.computed, item.unit, 3)

    def share(self, name: str) -> str:
        """Return the computed number in percent of the stated number."""
        item = self._items[name]
        return amount(100.0 * (item.computed or 0.0) / (item.stated or 1.0), "%", 4)


def causes_of(
    items: Iterable[Item], *known: Callable[[Quoted], RootCause]
) -> tuple[RootCause, ...]:
    """Return the causes that explain a disagreement, with numbers from the items."""
    listed = list(items)
    causes = (cause(Quoted(listed)) for cause in known)
    return tuple(cause for cause in causes if cause.explained(listed))
