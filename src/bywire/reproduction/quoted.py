"""Numbers of statements as text, for the sentences of a report."""

from __future__ import annotations

from collections.abc import Iterable

from bywire.report.wording import amount
from bywire.reproduction.item import Item


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
