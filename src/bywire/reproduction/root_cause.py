"""Why statements disagree: a few causes for many verdicts, in sentences with the numbers."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from fnmatch import fnmatchcase

from bywire.report.wording import amount
from bywire.reproduction.item import Item


@dataclass(frozen=True)
class RootCause:
    """A cause of disagreements.

    Parameters
    ----------
    text
        The cause in one sentence, with its numbers.
    explains
        Ids of the statements that it explains; ``*`` stands for anything.
    """

    text: str
    explains: tuple[str, ...]

    def explained(self, items: Iterable[Item]) -> list[Item]:
        """Return the disagreements that it explains."""
        return [
            item
            for item in items
            if item.agrees is False and any(fnmatchcase(item.id, name) for name in self.explains)
        ]


class Quoted:
    """The items' numbers, as text with unit."""

    def __init__(self, items: Iterable[Item]) -> None:
        self._items = {item.id: item for item in items}

    def stated(self, name: str) -> str:
        """Return what the source states."""
        item = self._items[name]
        return amount(item.stated, item.unit, 3)

    def __call__(self, name: str) -> str:
        """Return what we compute."""
        item = self._items[name]
        return amount(item.computed, item.unit, 3)

    def share(self, name: str) -> str:
        """Return what we compute in percent of what is stated."""
        item = self._items[name]
        return amount(100.0 * (item.computed or 0.0) / (item.stated or 1.0), "%", 4)


def causes_of(
    items: Iterable[Item], *known: Callable[[Quoted], RootCause]
) -> tuple[RootCause, ...]:
    """Return the causes that explain a disagreement, their numbers taken from the items."""
    listed = list(items)
    causes = (cause(Quoted(listed)) for cause in known)
    return tuple(cause for cause in causes if cause.explained(listed))
