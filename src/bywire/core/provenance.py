"""Where a value comes from, kept beside every value of the catalog."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal

from bywire.core.arguments import checked
from bywire.core.errors import ModelError

Kind = Literal["paper", "derived", "chosen", "calibrated"]
Formula = Callable[[Any], Any]
"""``formula(par)``: a value of a set from others, at their places, ``par.body.h``"""


@dataclass(frozen=True)
class Cited:
    """A value of a parameter set with its provenance.

    Parameters
    ----------
    value
        Number, table or choice, in SI.
    kind
        ``paper``: printed in the source. ``derived``: follows from printed values.
        ``chosen``: ours, where the source is silent. ``calibrated``: tuned until a statement of
        the source comes out; that statement is then no evidence.
    where
        Place in the source, or the reason.
    formula
        What a derived value follows from; None where no parameters of the set tell it.
    moved
        Where groups that the formula names stand instead, by their places there.
    """

    value: Any
    kind: Kind
    where: str
    formula: Formula | None = field(default=None, compare=False)
    moved: Mapping[str, str] = field(default_factory=dict, compare=False)

    def computed(self, values: Mapping[str, Any]) -> tuple[Any, frozenset[str]]:
        """Return what the formula gives with values by dotted name, and the names that it reads.

        It gives NaN where these values are so far off that it has no finite result.

        Raises
        ------
        ModelError
            When it reads a parameter that there is not.
        """
        assert self.formula is not None
        read: set[str] = set()
        try:
            value = self.formula(_Values(values, self.moved, read))
        except (ArithmeticError, ValueError):  # overflow, division by zero, root of a negative
            value = math.nan
        return value, frozenset(read)

    def moved_to(self, places: Mapping[str, str]) -> Cited:
        """Return the same in a set in which groups stand at other places, by those here.

        ``{"": "rear"}``: all of them in a group. Of a set that is put into another one.
        """
        return self if self.formula is None else replace(self, moved=places)


class _Values:
    """Values at their places, as a parameter set has them; notes which are read."""

    def __init__(
        self, values: Mapping[str, Any], moved: Mapping[str, str], read: set[str], place: str = ""
    ) -> None:
        self._values, self._moved, self._read, self._place = values, moved, read, place

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        place = f"{self._place}.{name}" if self._place else name
        there = _moved(place, self._moved)
        if there in self._values:
            self._read.add(there)
            return self._values[there]
        groups = (f"{there}.", f"{place}.")
        if not any(each.startswith(groups) for each in (*self._values, *self._moved)):
            raise ModelError(f"a formula of a derived value reads {there}, which the set lacks")
        return _Values(self._values, self._moved, self._read, place)


def _moved(place: str, moved: Mapping[str, str]) -> str:
    """Return where a place is found in a set whose groups stand elsewhere."""
    if "" in moved:
        return f"{moved['']}.{place}"
    for group, there in moved.items():
        if place == group or place.startswith(f"{group}."):
            return there + place[len(group) :]
    return place


@checked
def paper(value: Any, where: str) -> Cited:
    """Mark a value printed in the source."""
    return Cited(value, "paper", where)


@checked
def derived(value: Any, where: str) -> Cited:
    """Mark a value that follows from others.

    Parameters
    ----------
    value
        The value, or where it follows from parameters of the set the formula that computes it:
        ``derived(lambda par: 0.95 * par.body.g, "0.95 g")``. A bench that changes what the formula
        reads, and not the value, then warns of it.
    where
        What it follows from, for people.
    """
    if callable(value):
        return Cited(None, "derived", where, value)
    return Cited(value, "derived", where)


@checked
def chosen(value: Any, where: str) -> Cited:
    """Mark a value that is our choice, with its reason."""
    return Cited(value, "chosen", where)


@checked
def calibrated(value: Any, where: str) -> Cited:
    """Mark a value tuned to a statement of the source, with that statement."""
    return Cited(value, "calibrated", where)
