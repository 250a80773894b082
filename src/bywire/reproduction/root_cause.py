"""Why statements disagree: a few causes for many verdicts."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from fnmatch import fnmatchcase

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
