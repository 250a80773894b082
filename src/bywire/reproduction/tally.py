"""How many statements agree, disagree, or have no verdict, for each parameter set."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from bywire.reproduction.item import Item


@dataclass(frozen=True)
class Tally:
    """Numbers of verdicts."""

    agree: int
    disagree: int
    silent: int

    def __str__(self) -> str:
        return f"{self.agree} agree, {self.disagree} disagree, {self.silent} without verdict"


def tally(items: Iterable[Item]) -> Tally:
    """Count the verdicts."""
    verdicts = [item.agrees for item in items]
    return Tally(verdicts.count(True), verdicts.count(False), verdicts.count(None))


def tallies(items: Iterable[Item]) -> dict[str, Tally]:
    """Count the verdicts of each parameter set, by what follows ``@`` in the ids."""
    listed = list(items)
    names = dict.fromkeys(item.parameter_set for item in listed)
    return {name: tally(i for i in listed if i.parameter_set == name) for name in names}
